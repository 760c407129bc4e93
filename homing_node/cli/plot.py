# SPDX-License-Identifier: Apache-2.0
"""`homing plot`: draws a saved run."""

import argparse
from pathlib import Path

from ..plant.layout import AxisLayout
from ..plant.layout_file import LayoutFile
from .common import FAILED, OK, Failure, add_unit, layout_from, written

TEXT = """\
Draws a saved run: position, velocity and acceleration over time, the home states as coloured
bands, switch edges where they were taken.
"""

EXAMPLES = """\
examples:
  homing plot run.npz                                 writes run.png
  homing plot run.npz -o run.svg --layout machine.yaml --axis x
  homing plot run.csv -o position.png --panels position

"""

FAILURE = 'the file holds no course'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'record',
        metavar='RECORD',
        type=Path,
        help='a course saved by `homing run --save` (.npz or .csv)',
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
        help='draw the switches and hard stops of this layout, too',
    )
    parser.add_argument(
        '--axis',
        metavar='NAME',
        help="the axis in the layout (default: the only one, or the record's)",
    )
    parser.add_argument(
        '--panels',
        choices=('all', 'position', 'profile'),
        default='all',
        help='the position diagram, the profile, or both',
    )
    add_unit(parser, 'as the record says')


def run(arguments: argparse.Namespace) -> int:
    from ..figures import plot, record

    try:
        course, title, unit = record.load(arguments.record)
    except record.InvalidRecord as error:
        raise Failure(str(error), status=FAILED) from None
    except OSError as error:
        raise Failure(f'{arguments.record}: {error.strerror}') from None
    layout = layout_from(arguments.layout)
    panels = {'all': plot.WHOLE, 'position': plot.POSITION_DIAGRAM, 'profile': plot.PROFILE}
    path = arguments.output or arguments.record.with_suffix('.png')
    where = None if layout is None else _layout_of(layout, arguments, title)
    written(
        path,
        lambda: plot.save(
            path, course, where, title, panels[arguments.panels], arguments.unit or unit
        ),
    )
    print(f'wrote {path}')
    return OK


def _layout_of(layout: LayoutFile, arguments: argparse.Namespace, title: str) -> AxisLayout:
    """Return the axis of a layout that a record is of."""
    axis = arguments.axis or title.partition(':')[0]
    if not arguments.axis and axis not in layout.layouts and len(layout.layouts) == 1:
        return next(iter(layout.layouts.values()))
    if axis not in layout.layouts:
        raise Failure(
            f'{arguments.layout}: no axis {axis!r} in it; say which with --axis: '
            f'{", ".join(layout.layouts)}'
        )
    return layout.layouts[axis]
