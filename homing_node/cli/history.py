# SPDX-License-Identifier: Apache-2.0
"""`homing history`: what the memory of an axis says."""

import argparse
import json
import os
from datetime import datetime
from pathlib import Path

from ..memory.comparison import Memory, Rules
from ..memory.folder import SUFFIX, folder_path
from ..memory.records import Run
from ..memory.store import Contents, read
from ..parameters.node_fields import MEMORY_FOLDER
from ..parameters.units import Unit
from .common import FAILED, OK, Failure, add_node, count, written

TEXT = """\
Tells what is known of the homes of an axis: the newest runs, how steady home is, and the trend in
words. It reads the file that the node keeps.
"""

EXAMPLES = """\
examples:
  homing history x
  homing history x --memory ~/.ros/homing/cell_1/homing_node --last 30
  homing history x --plot x.png                   a control chart of the homes

doc/memory.md explains it.

"""

FAILURE = 'something has moved'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('axis', metavar='AXIS', help='the name of the axis')
    parser.add_argument(
        '--memory',
        metavar='FOLDER',
        default=MEMORY_FOLDER,
        help='the folder, as in the parameter memory (default: %(default)s)',
    )
    add_node(parser)
    parser.add_argument(
        '--last',
        metavar='N',
        type=count,
        default=10,
        help='how many runs to list (default: %(default)s)',
    )
    parser.add_argument(
        '--plot',
        metavar='FILE',
        type=Path,
        nargs='?',
        const=Path(),
        help='draw a control chart: .png, .svg or .pdf (default: AXIS_history.png)',
    )
    parser.add_argument('--json', action='store_true', help='print it as JSON')


def run(arguments: argparse.Namespace) -> int:
    axis = arguments.axis
    contents = _contents(arguments)
    if not contents.runs:
        raise Failure(f'there is no run of axis {axis} in the file', status=FAILED)
    rest = contents.rest
    unit = Unit(rest.unit if rest else Unit.m)
    memory = Memory(Rules(unit=unit, turn=rest.turn if rest else 0.0), _newest(contents))
    memory.replay(contents.runs)
    trends = memory.trends()
    if arguments.json:
        _print_json(axis, memory, trends)
    else:
        _print(axis, memory, trends, unit, arguments.last)
    if arguments.plot is not None:
        _plot(arguments, memory, unit)
    return FAILED if trends else OK


def _contents(arguments: argparse.Namespace) -> Contents:
    folder = folder_path(arguments.memory, arguments.node, os.environ)
    if folder is None:
        raise Failure('--memory: the name of a folder is needed')
    path = folder / f'{arguments.axis}{SUFFIX}'
    try:
        contents = read(path.read_bytes())
    except OSError as error:
        there = sorted(one.stem for one in folder.glob(f'*{SUFFIX}'))
        axes = f' (there is {", ".join(there)})' if there else ''
        raise Failure(f'{path}: {error.strerror}{axes}') from None
    return contents


def _newest(contents: Contents) -> str:
    """Return the newest configuration: runs of others are not compared with it."""
    return contents.runs[-1].configuration


def _print(axis: str, memory: Memory, trends: tuple[str, ...], unit: Unit, last: int) -> None:
    runs = memory.runs
    homed = sum(run.error == 'NoError' for run in runs)
    print(f'axis {axis}: {len(runs)} runs are kept, {homed} of them homed')
    series = memory.series()
    centre = series.centre if series and series.known else None
    if series and centre is not None:
        least = max(one.uncertainty for one in series.values)
        steady = unit.length(series.scale(least))
        print(f'home is at {centre:.6f} {unit} (raw), steady within {steady}')
    else:
        print('there are too few runs to compare: the first 5 are only collected')
    for text in trends or ('nothing moves',):
        print(text)
    print()
    print(f'{"run":>5}  {"when":16}  {"kind":6}  {"time":>8}  {"change":>10}  how it ended')
    for run in runs[-last:]:
        print(_line(run, centre, unit))


def _line(run: Run, centre: float | None, unit: Unit) -> str:
    when = f'{datetime.fromtimestamp(run.time):%Y-%m-%d %H:%M}'
    change = (
        '' if run.home is None or centre is None else unit.length(run.home - centre, sign=True)
    )
    warm = '' if run.temperature is None else f'  {run.temperature:5.1f} °C'
    accepted = ' (accepted)' if run.accepted else ''
    return (
        f'{run.number:5}  {when}  {run.kind:6}  {run.duration:6.2f} s  {change:>10}{warm}  '
        f'{run.error}{accepted}'
    )


def _print_json(axis: str, memory: Memory, trends: tuple[str, ...]) -> None:
    series = memory.series()
    known = series is not None and series.known
    print(
        json.dumps(
            {
                'axis': axis,
                'ok': not trends,
                'trends': trends,
                'centre': series.centre if series and known else None,
                'runs': [
                    {
                        'number': run.number,
                        'time': run.time,
                        'kind': run.kind,
                        'error': run.error,
                        'duration': run.duration,
                        'home_position_raw': run.home,
                        'uncertainty': run.uncertainty,
                        'temperature': run.temperature,
                        'quantities': {name: pair[0] for name, pair in run.quantities.items()},
                    }
                    for run in memory.runs
                ],
            },
            indent=2,
        )
    )


def _plot(arguments: argparse.Namespace, memory: Memory, unit: Unit) -> None:
    from ..figures import control_chart

    series = memory.series()
    if series is None or not series.known:
        raise Failure('--plot: there are too few runs to draw', status=FAILED)
    path = arguments.plot if arguments.plot.name else Path(f'{arguments.axis}_history.png')
    title = f'{arguments.axis}: homes around {series.centre:.6f} {unit} (raw)'
    written(path, lambda: control_chart.draw(path, series, title, unit))
    if not arguments.json:
        print(f'\nwrote {path}')
