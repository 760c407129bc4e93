# SPDX-License-Identifier: Apache-2.0
"""`homing home`: homes axes of the running machine."""

import argparse
import json
import math
from collections.abc import Callable
from typing import Any

from .common import FAILED, OK, Failure, add_axes, add_node, console
from .live import STATUS, connected
from .progress import Display

TEXT = """\
Homes axes through a running homing_node, and shows how far each of them has come. The axes move.
Needs ROS.

Without names it homes all axes in the order of home_sequence. Of a coordinator the axes are
CELL/AXIS, and their order is that of its steps.
"""

EXAMPLES = f"""\
examples:
  homing home
  homing home x y
  homing home x --node /cell_2/homing_node
  homing home --dry-run                           the order, the times, what is missing
  homing home --node /homing_coordinator --force cell1/x
  homing home --json | jq .states

{STATUS}"""

FAILURE = 'an axis was not homed'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    add_node(parser)
    parser.add_argument(
        '--dry-run',
        action='store_true',
        help='nothing moves: tell the order, how long each step takes, and what is missing',
    )
    parser.add_argument(
        '--force',
        action='store_true',
        help='home what is homed, too: a coordinator leaves it out otherwise (skip_homed)',
    )
    parser.add_argument('--json', action='store_true', help='print the result as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    axes, force = arguments.axes, arguments.force
    with connected(arguments) as client:
        if arguments.dry_run:
            return _preview(arguments, client.home(*axes, dry_run=True, force=force))
        return request(arguments, lambda show: client.home(*axes, force=force, on_feedback=show))


def _preview(arguments: argparse.Namespace, answer: Any) -> int:
    """Show the answer to a dry run; return the exit status.

    Raises:
        Failure: Something is missing.
    """
    if arguments.json:
        print(json.dumps(as_dict(answer), indent=2))
        return OK if answer else FAILED
    for number, (axes, lasts) in enumerate(zip(answer.steps, answer.durations, strict=True), 1):
        print(f'step {number}: {axes}: {seconds(lasts)}')
    if len(answer.steps) > 1:
        print(f'in all: {seconds(sum(answer.durations))}')
    if not answer.steps and answer:
        print('there is nothing to home: every axis is homed (--force homes them, too)')
    if not answer:
        missing = answer.missing or [answer.message]
        raise Failure(*(f'missing: {one}' for one in missing), status=FAILED)
    print(answer.message.removeprefix('dry run: '))
    return OK


def seconds(duration: float) -> str:
    """Return how long something takes, in words."""
    return 'how long is not known' if math.isnan(duration) else f'about {duration:.1f} s'


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
        'steps': list(answer.steps),
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
        **(of_dry_run(answer) if answer.durations or answer.missing else {}),
    }


def of_dry_run(answer: Any) -> dict[str, Any]:
    """Return what only a dry run tells; a time that is not known is null."""
    durations = [None if math.isnan(one) else one for one in answer.durations]
    return {'durations': durations, 'missing': list(answer.missing)}
