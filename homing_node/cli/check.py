# SPDX-License-Identifier: Apache-2.0
"""`homing check`: proves a configuration before the first motion."""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path

from ..check import Finding, Severity, check, errors
from ..check.finding import worst_first
from ..parameters.configuration import Configuration
from ..parameters.definition import InvalidParameters
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from .common import (
    FAILED,
    OK,
    add_configuration,
    add_timing,
    configuration_of,
    console,
    layout_from,
    only,
    positive,
    show_findings,
    timing_of,
)

TEXT = """\
Checks the parameters of homing_node before anything moves, and says of each fault why it is
one, the number, and the value that would be right.

With a layout (where the switches, hard stops and index pulses are; what you do not know you
leave out) it computes how far the axis goes on behind every switch: until the message has come,
until the deceleration has grown, until the axis rests; and compares that with the room before
the next switch and the hard stop, at both ends, at the speed at which this home type comes there.
Of a gantry it compares the sides, and rehearses it with a dead, a stuck and a swapped switch.
"""

EXAMPLES = """\
examples:
  homing check axes.yaml
  homing check axes.yaml --layout machine.yaml
  homing check axes.yaml --layout machine.yaml --feedback-rate 100 --accuracy 1e-5
  homing check axes.yaml --layout machine.yaml --json | jq '.findings[].right'

a layout:
  x:
    hard_stops: [-0.005, 0.205]             # raw positions, m; null: not known
    negative_limit_switch: [null, 0.0]      # on from the hard stop up to here
    positive_limit_switch: [0.195, null]
    home_switch: [0.150, 0.160]
    home_switch_hysteresis: 0.00005
    index_pitch: 0.01                       # pulses at index_offset + k * index_pitch
    index_offset: 0.0037
    lag: 0.005                              # s, from the command to the feedback
  The parameter file of simulated_axes is a layout, too. Further keys: the near_ and external_
  limit switches, inverted, touch_probe, start, command_timeout, stop_dec; doc/check.md tells all
  keys, and the cause and remedy of each finding.

severities:
  error    a run fails, or the axis hits something
  warning  it works, but not as it should, or not from everywhere
  info     worth knowing

"""

FAILURE = 'an error was found, be it that the node cannot use CONFIG'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument(
        '--layout', metavar='LAYOUT', type=Path, help='where things are along the axes (YAML)'
    )
    add_timing(parser)
    parser.add_argument(
        '--accuracy', metavar='M', type=positive, help='how well home must be known, m or rad'
    )
    parser.add_argument('--axis', metavar='NAME', help='only this axis')
    parser.add_argument('--json', action='store_true', help='print the findings as JSON')


def run(arguments: argparse.Namespace) -> int:
    layout = layout_from(arguments.layout)
    try:
        configuration = configuration_of(arguments)
    except InvalidParameters as error:
        found = [_fault(fault) for fault in error.faults]
    else:
        axes = only(arguments.axis, configuration.axes)
        layouts = None if layout is None else layout.layouts
        timing = timing_of(arguments, layout)
        found = check(configuration, layouts, timing)
        found += _rehearsed(configuration, layouts, timing, found)
        found = worst_first(one for one in found if one.axis.partition('.')[0] in axes)
    failed = bool(errors(found))
    if arguments.json:
        print(
            json.dumps({'ok': not failed, 'findings': [one.as_dict() for one in found]}, indent=2)
        )
    else:
        show_findings(console(), found, str(arguments.config))
    return FAILED if failed else OK


def _rehearsed(
    configuration: Configuration,
    layouts: Mapping[str, AxisLayout] | None,
    timing: Timing,
    known: list[Finding],
) -> list[Finding]:
    """Rehearse what cannot be computed: gantries with faults, and timeouts; with a layout only."""
    if layouts is None:
        return []
    from ..check.rehearsed_time import too_short
    from ..check.side_faults import rehearsed

    return [
        *(rehearsed(configuration, layouts, timing) if configuration.followers else ()),
        *too_short(configuration, layouts, known),
    ]


def _fault(text: str) -> Finding:
    """Return a finding that says what is wrong in the file itself."""
    return Finding(Severity.error, '', 'configuration', text, 'the node does not start with it')
