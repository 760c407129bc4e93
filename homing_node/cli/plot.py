# SPDX-License-Identifier: Apache-2.0
"""`homing plot`: draws a saved run."""

import argparse
from pathlib import Path
from typing import NamedTuple

from ..course import Course
from ..parameters import yaml_file
from ..parameters.configuration import Configuration
from ..parameters.definition import InvalidParameters
from ..plant.layout import AxisLayout
from ..plant.layout_file import LayoutFile
from ..plant.timing import Timing
from ..rehearsal.difference import differences
from ..rehearsal.sweep import rehearse_from, transport_of
from .common import FAILED, OK, Failure, add_unit, layout_from, written
from .place import place_of

TEXT = """\
Draws a saved run: position, velocity and acceleration over time, the home states as coloured
bands, switch edges where they were taken.

A record of the node (.mcap) is drawn alike; no ROS is needed. With --layout the rehearsal of the
same configuration from the same start is drawn beneath it, and words say where they differ.
"""

EXAMPLES = """\
examples:
  homing plot run.npz                                 writes run.png
  homing plot run.npz -o run.svg --layout machine.yaml --axis x
  homing plot run.csv -o position.png --panels position
  homing plot ~/.ros/homing/records/20261128T110635-633377.homing_node.z.Homed.mcap \\
      -o z.png --layout machine.yaml

"""

FAILURE = 'the file holds no course'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'record',
        metavar='RECORD',
        type=Path,
        help='a course saved by `homing run --save` (.npz or .csv), or a record of the node '
        '(.mcap)',
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        type=Path,
        help='.png, .svg or .pdf (default: RECORD with .png)',
    )
    parser.add_argument(
        '--layout',
        metavar='LAYOUT',
        type=Path,
        help='draw the switches and hard stops of this layout, too, and beneath a record its '
        'rehearsal',
    )
    parser.add_argument(
        '--axis',
        metavar='NAME',
        help="the axis in the record and in the layout (default: the only one, or the record's)",
    )
    parser.add_argument(
        '--panels',
        choices=('all', 'position', 'profile'),
        default='all',
        help='the position diagram, the profile, or both',
    )
    add_unit(parser, 'as the record says')


class Loaded(NamedTuple):
    """A run that was read from a file.

    Attributes:
        course: What the axis did.
        title: What stands above the picture.
        unit: The unit of positions.
        axis: The axis; '' if it is not known.
        cut: Why the record ends before the run, '' if it does not.
        configuration: The parameters of the run; None if they are not in the file.
    """

    course: Course
    title: str
    unit: str
    axis: str
    cut: str = ''
    configuration: Configuration | None = None


def run(arguments: argparse.Namespace) -> int:
    from ..figures import plot

    path = arguments.output or arguments.record.with_suffix('.png')
    try:
        found = _load(arguments.record, arguments.axis or '')
    except OSError as error:
        raise Failure(f'{arguments.record}: {error.strerror}') from None
    layout = layout_from(arguments.layout)
    panels = {'all': plot.WHOLE, 'position': plot.POSITION_DIAGRAM, 'profile': plot.PROFILE}
    where = None if layout is None else _layout_of(layout, arguments, found.axis)
    beneath: Course | None = None
    words: list[str] = []
    if layout is not None and where is not None and found.configuration is not None:
        beneath, words = _rehearsed(arguments, layout, found)
    unit = arguments.unit or found.unit
    written(
        path,
        lambda: plot.save(
            path, found.course, where, found.title, panels[arguments.panels], unit, beneath
        ),
    )
    if found.cut:
        print(f'{arguments.record}: {found.cut}; drawn up to there')
    for word in words:
        print(word)
    print(f'wrote {path}')
    return OK


def _load(path: Path, axis: str) -> Loaded:
    """Read a run.

    Raises:
        Failure: There is none in the file.
        OSError: It cannot be read.
    """
    from ..figures import record

    if path.suffix != '.mcap':
        try:
            course, title, unit = record.load(path)
        except record.InvalidRecord as error:
            raise Failure(str(error), status=FAILED) from None
        return Loaded(course, title, unit, title.partition(':')[0])
    try:
        from ..recording import reading
    except ImportError as error:
        raise Failure(f'{path}: {error}: pip install mcap mcap-ros2-support') from None
    try:
        found = reading.read(path, axis)
    except reading.NoRun as error:
        raise Failure(str(error), status=FAILED) from None
    configuration, unit = None, found.unit
    if found.parameters:
        try:
            text = found.parameters.encode()
            configuration = yaml_file.checked(yaml_file.parsed(text, path, found.node))
        except InvalidParameters:  # of another version
            print(f'{path}: this version does not know its parameters: no rehearsal')
        else:
            unit = str(configuration.axes[found.axis].unit)
    return Loaded(found.course, found.title, unit, found.axis, found.cut, configuration)


def _rehearsed(
    arguments: argparse.Namespace, layout: LayoutFile, found: Loaded
) -> tuple[Course | None, list[str]]:
    """Rehearse what was recorded, from where it began; return it, and where both differ."""
    assert found.configuration is not None
    parameters = found.configuration.axes[found.axis]
    if not found.course.samples:
        return None, ['the run has no setpoints: no rehearsal']
    followers = found.configuration.followers.get(found.axis, {})
    where = place_of(
        arguments.layout,
        layout,
        found.axis,
        parameters,
        f'the record {arguments.record}',
        followers,
    )
    sides = {found.axis: (found.course, where)} | {
        name: (found.course.followers[name], where.followers[name]) for name in followers
    }
    starts = {name: course.samples[0].feedback for name, (course, _) in sides.items()}
    for name, (_, side) in sides.items():
        low, high = side.hard_stops
        if not low <= starts[name] <= high:
            unit = parameters.unit
            what = 'the run' if name == found.axis else name
            text = f'{what} began at {starts[name]:g} {unit}, beyond the hard stops of the layout'
            return None, [f'{text}: no rehearsal']
    where = where._replace(
        start=starts[found.axis],
        followers={
            name: side._replace(start=starts[name]) for name, side in where.followers.items()
        },
    )
    timing = Timing(
        update_rate=found.configuration.update_rate,
        feedback_rate=layout.feedback_rate,
        latency=Timing().latency if layout.dead_time is None else layout.dead_time,
        lead=found.configuration.lead,
    )
    transport = transport_of(timing)
    course = rehearse_from(parameters, where, transport, where.start, found.axis, followers).course
    return course, differences(found.course, course, parameters.unit)


def _layout_of(layout: LayoutFile, arguments: argparse.Namespace, axis: str) -> AxisLayout:
    """Return the axis of a layout that a record is of."""
    axis = arguments.axis or axis
    if not arguments.axis and axis not in layout.layouts and len(layout.layouts) == 1:
        return next(iter(layout.layouts.values()))
    if axis not in layout.layouts:
        raise Failure(
            f'{arguments.layout}: no axis {axis!r} in it; say which with --axis: '
            f'{", ".join(layout.layouts)}'
        )
    return layout.layouts[axis]
