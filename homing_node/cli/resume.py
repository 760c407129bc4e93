# SPDX-License-Identifier: Apache-2.0
"""`homing continue`: lets axes go on that pause before a turn."""

import argparse

from .common import FAILED, OK, Failure, add_node
from .live import STATUS, axes_of, connected

TEXT = """\
Lets axes go on that wait before a turn (pause_mode). The axes move. Needs ROS.

Without names it lets every axis go on that is paused.
"""

EXAMPLES = f"""\
examples:
  homing continue
  homing continue x --node /cell_2/homing_node

{STATUS}"""

FAILURE = 'an axis was not paused, or none was'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'axes', metavar='AXIS', nargs='*', help='the names of axes (default: all that are paused)'
    )
    add_node(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    with connected(arguments) as client:
        axes = axes_of(client, 'continue', arguments.axes)
        if not arguments.axes:
            axes = [axis for axis in axes if client.state(axis).paused]
            if not axes:
                raise Failure('no axis is paused', status=FAILED)
        answers = {axis: client.resume(axis) for axis in axes}
    for axis, answer in answers.items():
        if answer:
            print(f'{axis}: it goes on')
    refused = [answer.message for answer in answers.values() if not answer]
    if refused:
        raise Failure(*refused, status=FAILED)
    return OK
