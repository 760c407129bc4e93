# SPDX-License-Identifier: Apache-2.0
"""`homing verify`: compares the homes of axes with what is found again."""

import argparse

from .common import add_axes, add_node
from .home import request
from .live import STATUS, axes_of, connected

TEXT = """\
Looks whether the homes of axes still hold: each axis searches its home again, and keeps the one
that it has. The axes move. Needs ROS.

Without names it verifies all axes.
"""

EXAMPLES = f"""\
examples:
  homing verify
  homing verify x --node /cell_2/homing_node

{STATUS}"""

FAILURE = 'a home could not be verified, or it has moved'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    add_node(parser)
    parser.add_argument('--json', action='store_true', help='print the result as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    with connected(arguments) as client:
        axes = axes_of(client, 'verify', arguments.axes)
        return request(arguments, lambda show: client.verify(*axes, on_feedback=show))
