# SPDX-License-Identifier: Apache-2.0
"""Jerk-limited setpoints of one axis; the only module that uses ruckig.

Searches and stops use ruckig's velocity interface, moves its position interface. Everything is in
the axis's *toward* frame: positive along the homing direction. Units: m or rad, s.

Source of the trajectories: L. Berscheid, T. Kroeger, "Jerk-limited Real-time Trajectory
Generation with Arbitrary Target States", 2021 (ruckig).
"""

from typing import NamedTuple

from ruckig import (
    ControlInterface,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    RuckigError,
    Trajectory,
)

#: Below this a velocity or a distance is ruckig's rounding, not a motion.
TINY = 1e-12
#: ruckig finds no trajectory where two of its cases meet exactly (a move of 2 a^3 / j^2, say); a
#: jerk smaller by this part leaves that point.
OFF_THE_POINT = 1e-6
ATTEMPTS = 5


class Dynamics(NamedTuple):
    """The limits of a motion: velocity, acceleration, deceleration (all > 0)."""

    velocity: float
    acceleration: float
    deceleration: float


class Profile:
    """The commanded position, velocity and acceleration of one axis, a cycle at a time.

    ``position``, ``velocity`` and ``acceleration`` are the command of the present cycle; ``done``
    tells that the last motion has reached its velocity or target; ``dynamics`` are those in use.
    """

    __slots__ = (
        'position',
        'velocity',
        'acceleration',
        'done',
        'period',
        'dynamics',
        '_otg',
        '_in',
        '_out',
        '_next',
        '_max_jerk',
    )

    def __init__(self, period: float, max_jerk: float, position: float = 0.0) -> None:
        self.period = period
        self._otg = Ruckig(1, period)
        self._in = InputParameter(1)
        self._out = OutputParameter(1)
        self._max_jerk = max_jerk
        self._in.target_acceleration = [0.0]
        self.dynamics = Dynamics(1.0, 1.0, 1.0)
        self._next: tuple[float, Dynamics] | None = None
        self.reset(position)

    def reset(self, position: float) -> None:
        """Set the command to a position at rest."""
        self.position, self.velocity, self.acceleration = position, 0.0, 0.0
        self.done = True
        self._next = None
        self._in.current_position = [position]
        self._in.current_velocity = [0.0]
        self._in.current_acceleration = [0.0]

    def seek(self, velocity: float, dynamics: Dynamics) -> None:
        """Go to a velocity (signed) and keep it.

        A reversal is one continuous trajectory through zero with min(acceleration, deceleration)
        of the dynamics that the axis leaves; where the new ones accelerate more gently than that,
        they take over at rest. Slowing down uses the deceleration of those that the axis leaves.
        """
        old = self.dynamics
        if self.velocity * velocity < 0.0:
            limit = min(old.acceleration, old.deceleration)
            if dynamics.acceleration < limit:
                self._to_velocity(0.0, limit, limit)
                self._next = (velocity, dynamics)
            else:
                self._to_velocity(velocity, limit, limit)
                self.dynamics = dynamics
        elif abs(velocity) < abs(self.velocity) - TINY:
            self._to_velocity(velocity, dynamics.acceleration, old.deceleration)
            self._next = (velocity, dynamics)
        else:
            self._to_velocity(velocity, dynamics.acceleration, dynamics.deceleration)
            self.dynamics = dynamics

    def stop(self, deceleration: float | None = None) -> None:
        """Come to rest with a deceleration, by default that of the present dynamics."""
        if self.velocity == 0.0 and self.acceleration == 0.0:
            self.freeze()
            return
        if deceleration is None:
            deceleration = self.dynamics.deceleration
        self._to_velocity(0.0, deceleration, deceleration)

    def brake_harder(self, deceleration: float) -> None:
        """Brake with at least this deceleration on the way to a stop or a reversal.

        A stop that comes meanwhile is no gentler.
        """
        target, old = self._in.target_velocity[0], self.dynamics
        then = self._next or ((target, old) if target else None)
        limit = max(deceleration, old.deceleration)
        self._to_velocity(0.0, limit, limit)
        self._next, self.dynamics = then, old._replace(deceleration=limit)

    def move(self, target: float, dynamics: Dynamics) -> None:
        """Go to a position and rest there."""
        self.dynamics, self._next = dynamics, None
        _, acceleration, deceleration = dynamics
        forward = target >= self.position
        inp = self._in
        inp.control_interface = ControlInterface.Position
        inp.current_position = [self.position]
        inp.max_jerk = [self._max_jerk]
        inp.target_position = [target]
        inp.target_velocity = [0.0]
        inp.max_velocity = [dynamics.velocity]
        inp.max_acceleration = [acceleration if forward else deceleration]
        inp.min_acceleration = [-deceleration if forward else -acceleration]
        self.done = target == self.position and self.velocity == 0.0

    def freeze(self) -> None:
        """Stop at once, with infinite deceleration."""
        self.reset(self.position)

    def stopping_position(self, deceleration: float) -> float:
        """Return where a stop that begins now would end."""
        inp = InputParameter(1)
        inp.control_interface = ControlInterface.Velocity
        inp.current_position = [self.position]
        inp.current_velocity = [self.velocity]
        inp.current_acceleration = [self.acceleration]
        inp.target_velocity = [0.0]
        inp.max_acceleration = [deceleration]
        inp.max_jerk = [self._max_jerk]
        trajectory = Trajectory(1)
        Ruckig(1).calculate(inp, trajectory)
        return float(trajectory.at_time(trajectory.duration)[0][0])

    def update(self) -> None:
        """Advance by one period.

        Raises ArithmeticError where the limits allow no trajectory; the command then stays.
        """
        if self.done:  # at rest, or at the velocity that was wanted
            self.position += self.velocity * self.period
            return
        inp, out = self._in, self._out
        for _ in range(ATTEMPTS):
            try:
                result = self._otg.update(inp, out)
                break
            except RuckigError as error:
                problem = error
                inp.max_jerk = [inp.max_jerk[0] * (1.0 - OFF_THE_POINT)]
        else:
            raise ArithmeticError(f'no trajectory: {problem}')
        out.pass_to_input(inp)
        (self.position,) = out.new_position
        (self.velocity,) = out.new_velocity
        (self.acceleration,) = out.new_acceleration
        if result is Result.Finished:
            self._arrive()

    def _arrive(self) -> None:
        """Leave ruckig's rounding behind; go on with what comes next."""
        self.done, then = True, self._next
        if self._in.control_interface is ControlInterface.Position:
            self.reset(self._in.target_position[0])
        elif self._in.target_velocity[0] == 0.0:
            self.reset(self.position)
        if then:
            self.seek(*then)

    def _to_velocity(self, velocity: float, acceleration: float, deceleration: float) -> None:
        """Aim at a velocity; ``acceleration`` is used where the speed grows."""
        self._next = None
        # The acceleration that raises the speed points along the target, or, for a stop, nowhere.
        forward = velocity > 0.0 or (velocity == 0.0 and self.velocity < 0.0)
        inp = self._in
        inp.control_interface = ControlInterface.Velocity
        inp.current_position = [self.position]
        inp.max_jerk = [self._max_jerk]
        inp.target_velocity = [velocity]
        inp.max_acceleration = [acceleration if forward else deceleration]
        inp.min_acceleration = [-deceleration if forward else -acceleration]
        self.done = False
