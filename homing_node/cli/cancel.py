# SPDX-License-Identifier: Apache-2.0
"""`homing cancel`: stops axes that home."""

import argparse

from .common import FAILED, OK, Failure, add_axes, add_node
from .live import STATUS, connected

TEXT = """\
Stops axes that home, whoever has asked for it, and ends when they are at rest. Needs ROS.

Without names it stops all axes. It is no emergency stop: it travels through ROS.
"""

EXAMPLES = f"""\
examples:
  homing cancel
  homing cancel x --node /cell_2/homing_node

{STATUS}"""

FAILURE = 'the node did not do it'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    add_node(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    with connected(arguments) as client:
        answers = client.cancel_each(*arguments.axes) if arguments.axes else {'': client.cancel()}
    failed = []
    for axis, answer in answers.items():
        text = f'{axis}: {answer.message}' if axis else answer.message
        if answer:
            print(text)
        else:
            failed.append(text)
    if failed:
        raise Failure(*failed, status=FAILED)
    return OK
