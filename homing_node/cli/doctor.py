# SPDX-License-Identifier: Apache-2.0
"""`homing doctor`: asks the running system what would keep a run from going well."""

import argparse
import json
from pathlib import Path

from ..check import errors
from ..diagnosis import diagnose
from ..parameters.definition import InvalidParameters
from .common import (
    FAILED,
    OK,
    Failure,
    add_node,
    console,
    layout_from,
    not_negative,
    show_findings,
)
from .live import absent, coordinator, full

TEXT = """\
Asks the running system, and says what to change before anything moves. Needs ROS.

It looks at a running homing_node from outside: the controller behind its setpoints and its
parameters, the controller manager, other publishers, the feedback, and every input: who publishes
it, how often, with which QoS, by which clock. It reads only: nothing is set, nothing is published,
nothing moves. ros2_control need not be there.
"""

EXAMPLES = """\
examples:
  homing doctor
  homing doctor --node /cell_2/homing_node
  homing doctor --layout machine.yaml             the lag of each drive, for the tolerances
  homing doctor --json | jq '.findings[].right'

severities:
  error    no run starts, or it fails, or the axis does something else than planned
  warning  it works, but not as it should, or not always
  info     worth knowing

doc/doctor.md explains each finding.

"""

FAILURE = 'an error was found (2, too, where there is no such node)'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_node(parser)
    parser.add_argument(
        '--listen',
        metavar='S',
        type=not_negative,
        default=3.0,
        help='how long to listen to the inputs (default: %(default)g s)',
    )
    parser.add_argument(
        '--layout', metavar='LAYOUT', type=Path, help="a layout file, for each drive's lag (YAML)"
    )
    parser.add_argument('--json', action='store_true', help='print the findings as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command; only here ROS is imported."""
    layout = layout_from(arguments.layout)
    lags = {} if layout is None else {axis: one.lag for axis, one in layout.layouts.items()}
    node = full(arguments.node)
    try:
        from ..ros.asking import IsCoordinator
        from ..ros.doctor import NoSuchNode, examine
    except ImportError as error:
        raise Failure(f'`homing doctor` needs ROS 2 ({error})') from None
    try:
        found = diagnose(examine(node, arguments.listen, lags=lags))
    except NoSuchNode as error:
        raise Failure(*_absent(node, error.there)) from None
    except IsCoordinator as error:
        raise Failure(coordinator(node, 'doctor', error.nodes)) from None
    except InvalidParameters as error:
        raise Failure(
            f'the parameters of {node} contradict each other:', *error.faults, status=FAILED
        ) from None
    failed = bool(errors(found))
    if arguments.json:
        report = {'node': node, 'ok': not failed, 'findings': [one.as_dict() for one in found]}
        print(json.dumps(report, indent=2))
    else:
        show_findings(console(), found, node)
    return FAILED if failed else OK


def _absent(node: str, there: list[str]) -> list[str]:
    if node in there:
        return [f'{node} is there, but does not answer: its parameter services are silent']
    return absent(node, there, 'doctor')
