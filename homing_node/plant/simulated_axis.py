# SPDX-License-Identifier: Apache-2.0
"""The plant: simulated axes with switches, an encoder index and a touch probe.

Pure Python without a clock: time is passed in as steps. Positions are raw positions in m (linear
axis) or rad (rotary axis), times in s. Within a step the feedback is the straight line between
its two ends (carriage.py).
"""

from collections.abc import Sequence
from math import copysign, exp

from ..course import Happening
from .carriage import NOTHING, Carriage
from .layout import AxisLayout


class SimulatedAxis(Carriage):
    """One axis: a drive that follows setpoints, and what its inputs see of it.

    `time` (s), `position` (the feedback, which is also the true position), `command` (what the
    drive follows at this time) and `told` (the last setpoint), those in m or rad, are for reading.
    """

    __slots__ = (
        '_decay',
        '_decay_dt',
        '_goal',
        '_lag',
        '_own_stop',
        '_rate',
        '_remaining',
        '_servo',
        '_silence',
        '_timeout',
        '_velocity',
        'command',
        'told',
    )

    def __init__(self, layout: AxisLayout, position: float | None = None) -> None:
        """Put the axis at rest at `position` (default: the layout's start) at time 0.

        Raise ValueError if that is beyond a hard stop.
        """
        super().__init__(layout, position)
        self.command = self._goal = self.position
        self._remaining = 0.0  # s until the command is at the goal, coming at this rate
        self._rate = 0.0
        self.told = self.position
        self._velocity = 0.0  # at the goal: what the drive goes on with when no setpoint comes
        self._lag = layout.lag
        self._timeout, self._own_stop = layout.command_timeout, layout.stop_dec
        self._silence = 0.0  # s since a setpoint ended, while the drive goes on without the next
        self._decay_dt, self._decay = 0.0, 1.0  # exp(-dt / lag), for the dt it was last needed for
        self._servo = True

    def follow(self, position: float, over: float = 0.0, velocity: float | None = None) -> None:
        """Take the newest setpoint, in m or rad; a drive whose servo is off ignores it.

        The command goes linearly from where it is to `position` over `over` s; 0 = at once.
        `velocity`, per s, is the axis's at `position`; None: what leads there from the setpoint
        before. It is not how fast the command comes, which makes up for a setpoint that is late.
        """
        if not self._servo or self.timed_out:
            return
        if velocity is None:
            velocity = (position - self.told) / over if over > 0.0 else 0.0
        self._goal = self.told = position
        self._velocity = velocity
        self._silence = 0.0
        if over > 0.0:
            self._remaining = over
            self._rate = (position - self.command) / over
        else:
            self._remaining = self._rate = 0.0
            self.command = position

    def servo(self, on: bool) -> None:
        """Switch the servo; while it is off a brake holds the axis where it is."""
        self._servo = on
        self._silence = 0.0
        if not on:
            self.command = self._goal = self.told = self.position
            self._remaining = self._rate = self._velocity = 0.0

    @property
    def timed_out(self) -> bool:
        """Whether the drive has stopped, or is stopping, because no setpoint came."""
        return self._silence > self._timeout > 0.0

    @property
    def enabled(self) -> bool:
        """Whether the drive heeds setpoints, as it reports it."""
        return self._servo and not self.timed_out

    def step(self, dt: float) -> Sequence[Happening]:
        """Advance by `dt` s (> 0) and return what happened, in the order of time."""
        start = self.time
        before = self.position
        self.time = start + dt
        if self._timeout and self._velocity and self._remaining <= 0.0:
            self._go_on(dt)
        if self._remaining > 0.0:
            after = self._along_ramp(dt)
        elif before == self.command:
            return NOTHING
        else:
            after = self._settled(dt)
        if after > self._high:
            after = self._high
        elif after < self._low:
            after = self._low
        self.position = after
        if self._quiet_low < after < self._quiet_high or after == before:
            return NOTHING
        return self._happenings(start, dt, before, after)

    def _go_on(self, dt: float) -> None:
        """Make the drive's own setpoint for a step, because none has come."""
        self._silence += dt
        before = self._velocity
        if self.timed_out:
            self._velocity = copysign(max(0.0, abs(before) - self._own_stop * dt), before)
        self._rate = 0.5 * (before + self._velocity)
        self._goal += self._rate * dt
        self._remaining = dt

    def _settled(self, dt: float) -> float:
        """Return the feedback after `dt` s of the command standing still."""
        if not self._lag:
            return self.command
        if dt != self._decay_dt:
            self._decay_dt, self._decay = dt, exp(-dt / self._lag)
        return self.command + (self.position - self.command) * self._decay

    def _along_ramp(self, dt: float) -> float:
        """Return the feedback after `dt` s that begin with the command on its way."""
        offset = self.position - self.command
        ramp = dt if dt < self._remaining else self._remaining
        self._remaining -= ramp
        self.command = self._goal - self._rate * self._remaining
        if not self._lag:
            return self.command
        if ramp != self._decay_dt:
            self._decay_dt, self._decay = ramp, exp(-ramp / self._lag)
        drag = self._rate * self._lag  # what the feedback comes to stay behind
        after = self.command - drag + (offset + drag) * self._decay
        if ramp < dt:
            after = self.command + (after - self.command) * exp((ramp - dt) / self._lag)
        return after
