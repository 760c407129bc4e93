# SPDX-License-Identifier: Apache-2.0
"""The layout of an axis that is to be rehearsed."""

from math import isnan
from pathlib import Path

from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..plant.layout_file import LayoutFile
from ..procedures.states import Input
from .common import Failure


def place_of(
    path: Path, layout: LayoutFile, axis: str, parameters: AxisParameters, config: str
) -> AxisLayout:
    """Return the layout of an axis if it has all that a run needs.

    Args:
        path: The file of the layout.
        layout: What is in it.
        axis: The axis.
        parameters: The parameters of the axis.
        config: Where those come from.

    Raises:
        Failure: Something is missing.
    """
    where = layout.layouts.get(axis)
    if where is None:
        raise Failure(f'{path}: no axis {axis!r} in it, only {", ".join(layout.layouts)}')
    missing: list[Input] = [
        name
        for name in parameters.inputs
        if name not in where.switches
        and name not in (Input.SERVO_ENABLED, Input.Z_PULSE, Input.TOUCH_PROBE)
    ]
    used = parameters.procedure.inputs
    if Input.Z_PULSE in used and (not where.index_pitch or isnan(where.index_offset)):
        missing.append(Input.Z_PULSE)
    if Input.TOUCH_PROBE in used and where.touch_probe is None:
        missing.append(Input.TOUCH_PROBE)
    if missing:
        raise Failure(
            *(
                f'{path}: axis {axis}: a run needs to know where {name} is, which {config} has in '
                'switches'
                for name in missing
            )
        )
    if isnan(where.index_offset):
        where = where._replace(index_pitch=0.0, index_offset=0.0)
    return where
