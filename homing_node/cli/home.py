# SPDX-License-Identifier: Apache-2.0
"""`homing home`: homes axes of the running machine."""

import argparse
import json
from collections.abc import Callable
from typing import Any

from .common import FAILED, OK, Failure, add_axes, add_node, console
from .live import STATUS, connected
from .progress import Display

TEXT = """\
Homes axes through a running homing_node, and shows how far each of them has come. The axes move.
Needs ROS.

Without names it homes all axes in the order of home_sequence.
"""

EXAMPLES = f"""\
examples:
  homing home
  homing home x y
  homing home x --node /cell_2/homing_node
  homing home --json | jq .states

{STATUS}"""

FAILURE = 'an axis was not homed'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    add_node(parser)
    parser.add_argument('--json', action='store_true', help='print the result as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    with connected(arguments) as client:
        return request(arguments, lambda show: client.home(*arguments.axes, on_feedback=show))


def request(
    arguments: argparse.Namespace, ask: Callable[[Callable[[Any], None] | None], Any]
) -> int:
    """Send a goal, show its progress and its end; return the exit status.

    Args:
        arguments: The arguments of the verb.
        ask: Sends the goal and returns its answer; gets what takes the feedback.
    """
    if arguments.json:
        answer = ask(None)
        print(json.dumps(as_dict(answer), indent=2))
        return OK if answer else FAILED
    with Display(console()) as display:
        answer = ask(display.feedback)
        display.ended(answer.states)
    if not answer:
        raise Failure(answer.message, status=FAILED)
    print(answer.message)
    return OK


def as_dict(answer: Any) -> dict[str, Any]:
    """Return an answer of the node as plain values."""
    return {
        'ok': answer.success,
        'message': answer.message,
        'error': answer.error,
        'states': {
            state.axis: {
                'state': state.state,
                'homed': state.homed,
                'error': state.error,
                'message': state.message,
                'position': state.position,
                'home_offset': state.home_offset,
                'home_position_raw': state.home_position_raw,
                'uncertainty': state.uncertainty,
            }
            for state in answer.states
        },
    }
