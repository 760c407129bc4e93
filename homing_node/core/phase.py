# SPDX-License-Identifier: Apache-2.0
"""One phase of a motion: its limits, and the pieces of its path; the only module that uses ruckig.

Source of the trajectories: L. Berscheid, T. Kroeger, "Jerk-limited Real-time Trajectory
Generation with Arbitrary Target States", 2021 (ruckig).
"""

from collections.abc import Iterator
from typing import NamedTuple

from ruckig import ControlInterface, InputParameter, Ruckig, RuckigError, Trajectory

from .path import Piece, State

#: ruckig finds no trajectory where two of its cases meet exactly (a move of 2 a^3 / j^2, say); a
#: jerk smaller by this part leaves that point.
OFF_THE_POINT = 1e-6
ATTEMPTS = 5


class NoTrajectory(ArithmeticError):
    """The limits of a motion allow no trajectory."""


class Dynamics(NamedTuple):
    """The limits of a motion: velocity, acceleration, deceleration (all > 0)."""

    velocity: float
    acceleration: float
    deceleration: float


class Phase(NamedTuple):
    """One part of a motion: to a velocity, or to a position and rest there.

    ``dynamics`` are in use from its begin on, ``up`` and ``down`` bound the acceleration in the
    positive and in the negative direction; ``velocity`` is the target, or the limit of a move.
    """

    dynamics: Dynamics
    up: float
    down: float
    velocity: float
    position: float | None = None


def pieces_of(time: float, state: State, phase: Phase, jerk: float) -> Iterator[Piece]:
    """Yield the pieces of a phase; the last one goes on at its target.

    Args:
        time: When it begins, s.
        state: What it begins with.
        phase: The phase.
        jerk: The largest jerk, m/s^3.

    Raises:
        NoTrajectory: The limits allow none.
    """
    inp, trajectory = InputParameter(1), Trajectory(1)
    position, velocity, acceleration = state
    inp.current_position = [position]
    inp.current_velocity = [velocity]
    inp.current_acceleration = [acceleration]
    inp.max_acceleration, inp.min_acceleration = [phase.up], [-phase.down]
    if phase.position is None:
        inp.control_interface = ControlInterface.Velocity
        inp.target_velocity = [phase.velocity]
    else:
        inp.target_position = [phase.position]
        inp.max_velocity = [phase.velocity]
    for attempt in range(ATTEMPTS):
        inp.max_jerk = [jerk]
        try:
            Ruckig(1).calculate(inp, trajectory)
            break
        except RuckigError as error:
            if attempt == ATTEMPTS - 1:
                raise NoTrajectory(str(error)) from None
            jerk *= 1.0 - OFF_THE_POINT
    found = trajectory.profiles[0][0]
    brake = found.brake
    stretches = [
        *zip(brake.t, brake.p, brake.v, brake.a, brake.j, strict=True),
        *zip(found.t, found.p[:-1], found.v[:-1], found.a[:-1], found.j, strict=True),
    ]
    for duration, p, v, a, j in stretches:
        if duration > 0.0:
            yield Piece(time, p, v, a, j)
            time += duration
    if phase.position is None:
        yield Piece(time, found.p[-1], phase.velocity, 0.0, 0.0)
    else:
        yield Piece(time, phase.position, 0.0, 0.0, 0.0)


def to_velocity(
    dynamics: Dynamics, acceleration: float, deceleration: float, velocity: float, now: float
) -> Phase:
    """Aim at a velocity; ``acceleration`` is used where the speed grows."""
    # The acceleration that raises the speed points along the target, or, for a stop, nowhere.
    forward = velocity > 0.0 or (velocity == 0.0 and now < 0.0)
    if forward:
        return Phase(dynamics, acceleration, deceleration, velocity)
    return Phase(dynamics, deceleration, acceleration, velocity)
