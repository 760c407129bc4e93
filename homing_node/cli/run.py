# SPDX-License-Identifier: Apache-2.0
"""`homing run`: rehearses homing against a simulated axis."""

import argparse
import json
from dataclasses import replace
from math import isclose
from pathlib import Path

from ..parameters.axis import AxisParameters
from ..parameters.definition import InvalidParameters
from ..plant.layout import AxisLayout
from ..plant.layout_file import LayoutFile
from ..plant.timing import Timing
from ..procedures.states import HomeType
from ..rehearsal.gantry import Followers
from ..rehearsal.link import PLANT_STEP
from ..rehearsal.sweep import Trial, rehearse_from, transport_of
from .common import (
    FAILED,
    OK,
    Failure,
    add_configuration,
    add_timing,
    add_unit,
    configuration_of,
    console,
    count,
    layout_from,
    only,
    timing_of,
    written,
)
from .place import place_of
from .run_report import as_dict, show_run
from .sweep_axis import STARTS, sweep_axis

TEXT = """\
Rehearses homing against a simulated axis, more than a hundred times faster than the real thing:
the same code that drives the machine, the switches where the layout has them.
"""

EXAMPLES = """\
examples:
  homing run axes.yaml --layout machine.yaml
  homing run axes.yaml --layout machine.yaml --axis x --from 0.18 --plot run.png
  homing run axes.yaml --layout machine.yaml --axis x --type HSZPulse
  homing run axes.yaml --layout machine.yaml --axis x --save run.npz   (or .csv)
  homing run axes.yaml --layout machine.yaml --axis x --all-starts --plot starts.png

"""

FAILURE = 'a run failed, hit a hard stop, or home is further off than its uncertainty'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument(
        '--layout',
        metavar='LAYOUT',
        type=Path,
        required=True,
        help='where things are along the axes (YAML)',
    )
    parser.add_argument('--axis', metavar='NAME', help='only this axis (default: all)')
    parser.add_argument(
        '--from',
        metavar='POSITION',
        type=float,
        dest='start',
        help="raw start position (default: the layout's start)",
    )
    parser.add_argument(
        '--type',
        metavar='TYPE',
        choices=list(map(str, HomeType)),
        help='another home type than the configured one',
    )
    parser.add_argument(
        '--all-starts',
        action='store_true',
        help='run from everywhere along the travel, and draw what becomes of it',
    )
    parser.add_argument(
        '--starts',
        metavar='N',
        type=count,
        help=f'how many start positions for --all-starts (default: {STARTS})',
    )
    add_timing(parser)
    parser.add_argument(
        '--save', metavar='FILE', type=Path, help='save the course: .npz, or .csv for spreadsheets'
    )
    parser.add_argument(
        '--plot',
        metavar='FILE',
        type=Path,
        help='draw it: .png, .svg or .pdf (--all-starts: default AXIS_starts.png)',
    )
    add_unit(parser, 'as the axis has in CONFIG')
    parser.add_argument('--json', action='store_true', help='print the results as JSON')


def run(arguments: argparse.Namespace) -> int:
    layout = layout_from(arguments.layout)
    assert layout is not None
    try:
        configuration = configuration_of(arguments)
    except InvalidParameters as error:
        raise Failure(*error.faults) from None
    axes = only(arguments.axis, configuration.axes)
    alone = len(axes) == 1
    for option in ('start', 'save', 'plot'):
        if getattr(arguments, option) is not None and not alone:
            name = 'from' if option == 'start' else option
            raise Failure(f'--{name} is for one axis; say which: --axis {" or ".join(axes)}')
    if arguments.starts is not None and not arguments.all_starts:
        raise Failure('--starts is the number of starts for --all-starts: give both')
    if arguments.all_starts and arguments.start is not None:
        raise Failure('--from is one start, --all-starts are all: give one of them')
    if arguments.all_starts and arguments.save and arguments.save.suffix != '.csv':
        raise Failure(f'{arguments.save}: the table of --all-starts is saved as .csv')
    timing = timing_of(arguments, layout)._replace(update_rate=configuration.update_rate)
    if not arguments.json:
        _show_rates(timing)
    results: list[dict[str, object]] = []
    good = True
    for axis, parameters in axes.items():
        parameters = _with_type(parameters, arguments.type, axis)
        followers = {
            name: replace(own, home_type=parameters.home_type)
            for name, own in configuration.followers.get(axis, {}).items()
        }
        where = _place(arguments, layout, axis, parameters, followers)
        act = sweep_axis if arguments.all_starts else _run_axis
        trials = act(arguments, axis, parameters, where, timing, followers)
        results += [as_dict(axis, parameters, where, trial, timing) for trial in trials]
        good &= all(trial.success for trial in trials)
    if arguments.json:
        print(json.dumps({'ok': good, 'runs': results}, indent=2))
    return OK if good else FAILED


def _show_rates(timing: Timing) -> None:
    """Tell which rates the plant cannot keep."""
    transport = transport_of(timing)
    for name in ('update_rate', 'feedback_rate'):
        wanted, kept = getattr(timing, name), getattr(transport, name)
        if wanted and not isclose(wanted, kept):
            print(
                f'{name} is {wanted:g} Hz; rehearsed at {kept:.6g} Hz, the nearest that divides '
                f'{1 / PLANT_STEP:g} Hz'
            )


def _with_type(parameters: AxisParameters, home_type: str | None, axis: str) -> AxisParameters:
    if home_type is None:
        return parameters
    parameters = replace(parameters, home_type=HomeType(home_type))
    faults = parameters.cross_check()
    if faults:
        raise Failure(*(f'--type {home_type}: {axis}.{fault}' for fault in faults))
    return parameters


def _place(
    arguments: argparse.Namespace,
    layout: LayoutFile,
    axis: str,
    parameters: AxisParameters,
    followers: Followers,
) -> AxisLayout:
    """Return an axis's layout if it has all that a run needs."""
    where = place_of(arguments.layout, layout, axis, parameters, str(arguments.config), followers)
    if where.stays_off and not arguments.json:
        names = ', '.join(where.stays_off)
        print(f'axis {axis}: nobody knows where {names} is: rehearsed as off everywhere')
    low, high = where.hard_stops
    if arguments.start is not None and not low <= arguments.start <= high:
        raise Failure(
            f'--from: {arguments.start:g} {parameters.unit} is beyond the hard stops of axis '
            f'{axis}, {low:g} {parameters.unit} and {high:g} {parameters.unit}'
        )
    return where


def _run_axis(
    arguments: argparse.Namespace,
    axis: str,
    parameters: AxisParameters,
    where: AxisLayout,
    timing: Timing,
    followers: Followers,
) -> list[Trial]:
    try:
        trial = rehearse_from(
            parameters, where, transport_of(timing), arguments.start, axis, followers
        )
    except ValueError as error:  # a follower would be beyond a hard stop
        raise Failure(f'{arguments.layout}: axis {axis}: {error}') from None
    unit = arguments.unit or str(parameters.unit)
    title = f'{axis}: {parameters.home_type} from {trial.start:g} {unit}'
    files = []
    if arguments.save:
        from ..figures import record

        written(
            arguments.save,
            lambda: record.save(arguments.save, trial.course, title, unit),
        )
        files.append(arguments.save)
    if arguments.plot:
        from ..figures import plot

        written(
            arguments.plot,
            lambda: plot.save(arguments.plot, trial.course, where, title, unit=unit),
        )
        files.append(arguments.plot)
    if not arguments.json:
        show_run(console(), axis, parameters, trial, unit, files)
    return [trial]
