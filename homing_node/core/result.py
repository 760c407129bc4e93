# SPDX-License-Identifier: Apache-2.0
"""The result of a run that has ended: from the *toward* frame back to raw coordinates."""

from ..procedures.states import Error
from .machine import Machine
from .outcome import Outcome
from .signals import Edge


def outcome_of(machine: Machine, axis: str, finest: float) -> Outcome:
    """Return how a run ended and, if the axis is homed, where its home is.

    Args:
        machine: the run, which has finished.
        axis: the name of the axis, for the message.
        finest: the smallest uncertainty of a place that is no edge of a switch, m.
    """
    warnings, home = tuple(machine.warnings), machine.reference
    if machine.ending.error is not Error.NoError or home is None:
        return Outcome(
            machine.ending.error, f'axis {axis}: {machine.ending.message}', warnings=warnings
        )
    p, passes = machine.parameters, machine.passes
    sign = p.home_direction.sign
    on_edge = bool(passes.fine) and isinstance(passes.fine[0], Edge)
    raw = sign * home.position
    return Outcome(
        Error.NoError,
        home_position_raw=raw,
        home_offset=raw + sign * p.home_shift_distance - p.home_position,
        uncertainty=home.uncertainty if on_edge else max(home.uncertainty, finest),
        passes=len(passes.fine),
        passes_range=passes.range,
        passes_deviation=passes.deviation,
        index_margin=machine.movement.index_margin,
        warnings=warnings,
        unit=p.unit,
    )
