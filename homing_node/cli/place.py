# SPDX-License-Identifier: Apache-2.0
"""The layout of an axis that is to be rehearsed."""

from collections.abc import Iterator
from math import isnan
from pathlib import Path

from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..plant.layout_file import LayoutFile
from ..procedures.states import Input
from ..rehearsal.gantry import Followers
from ..rehearsal.sweep import NO_FOLLOWERS
from .common import Failure


def place_of(
    path: Path,
    layout: LayoutFile,
    axis: str,
    parameters: AxisParameters,
    config: str,
    followers: Followers = NO_FOLLOWERS,
) -> AxisLayout:
    """Return the layout of an axis if it has all that a run needs.

    Args:
        path: The file of the layout.
        layout: What is in it.
        axis: The axis.
        parameters: The parameters of the axis.
        config: Where those come from.
        followers: The parameters of the followers of a gantry, by their full names.

    Raises:
        Failure: Something is missing.
    """
    where = layout.layouts.get(axis)
    if where is None:
        raise Failure(f'{path}: no axis {axis!r} in it, only {", ".join(layout.layouts)}')
    absent = [name for name in followers if name not in where.followers]
    if absent:
        raise Failure(
            *(
                f'{path}: axis {axis}: a run needs to know its side {name}: add it to '
                f'{axis}.followers, and its stiffness as {name}.stiffness'
                for name in absent
            )
        )
    sides = {axis: (parameters, where)} | {
        name: (own, where.followers[name]) for name, own in followers.items()
    }
    missing = [(name, one) for name, side in sides.items() for one in _unknown_places(*side)]
    if missing:
        raise Failure(
            *(
                f'{path}: axis {name}: a run needs to know where {one} is, which {config} has in '
                'switches'
                for name, one in missing
            )
        )
    return _without_unknown_index(where)._replace(
        followers={name: _without_unknown_index(where.followers[name]) for name in followers}
    )


def _unknown_places(parameters: AxisParameters, where: AxisLayout) -> Iterator[Input]:
    """Yield the inputs whose place a run needs, and a layout does not tell."""
    for name in parameters.inputs:
        elsewhere = (Input.SERVO_ENABLED, Input.Z_PULSE, Input.TOUCH_PROBE)
        if not (name in where.switches or name in where.stays_off or name in elsewhere):
            yield name
    used = parameters.procedure.inputs
    if Input.Z_PULSE in used and (not where.index_pitch or isnan(where.index_offset)):
        yield Input.Z_PULSE
    if Input.TOUCH_PROBE in used and where.touch_probe is None:
        yield Input.TOUCH_PROBE


def _without_unknown_index(where: AxisLayout) -> AxisLayout:
    if isnan(where.index_offset):
        return where._replace(index_pitch=0.0, index_offset=0.0)
    return where
