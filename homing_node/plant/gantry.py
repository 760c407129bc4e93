# SPDX-License-Identifier: Apache-2.0
"""A simulated gantry: two or more sides, each with a drive, and springs between them.

Each side is used as a `SimulatedAxis` is: with setpoints, steps, levels and happenings of its own.
Its drive obeys as that of an axis does, with a lag and, if its layout says so, a delay. Its
position is where the drive says, plus how far the springs pull it off (racking.py).
"""

from collections import deque
from collections.abc import Mapping, Sequence

from ..course import Happening
from .carriage import NOTHING, Carriage
from .layout import AxisLayout
from .racking import FRICTION, Racking
from .simulated_axis import SimulatedAxis

#: What two sums of the same times or lengths may differ by, s or m.
ROUNDING = 1e-9


class Side(Carriage):
    """One side of a gantry.

    ``drive`` says where the side would be if nothing pulled at it, ``pace`` how fast that goes.
    """

    __slots__ = (
        '_delay',
        '_gantry',
        '_happened',
        '_number',
        '_on_the_way',
        'drive',
        'pace',
        'servo_on',
        'sign',
    )

    def __init__(
        self, gantry: 'Gantry', number: int, layout: AxisLayout, position: float | None
    ) -> None:
        """Put a side at rest at ``position`` (default: the layout's start)."""
        super().__init__(layout, position)
        self._gantry, self._number = gantry, number
        self.sign = -1.0 if layout.mirrored else 1.0
        self.drive = SimulatedAxis(
            layout._replace(switches={}, index_pitch=0.0, touch_probe=None), self.position
        )
        self.pace = 0.0
        self.servo_on = True
        self._delay = layout.delay
        self._on_the_way: deque[tuple[float, tuple[float, float, float | None]]] = deque()
        self._happened: Sequence[Happening] = NOTHING

    @property
    def command(self) -> float:
        """What the drive follows at this time, m or rad."""
        return self.drive.command

    @property
    def told(self) -> float:
        """The last setpoint that the drive has taken, m or rad."""
        return self.drive.told

    @property
    def timed_out(self) -> bool:
        """Whether the drive has stopped, or is stopping, because no setpoint came."""
        return self.drive.timed_out

    @property
    def enabled(self) -> bool:
        """Whether the drive heeds setpoints, as it reports it."""
        return self.drive.enabled

    @property
    def force(self) -> float:
        """What the spring between this follower and the leader bears, N; the leader has none."""
        return self._gantry.forces[self._number - 1] if self._number else 0.0

    def follow(self, position: float, over: float = 0.0, velocity: float | None = None) -> None:
        """Take a setpoint, as `SimulatedAxis.follow`; it acts after the side's delay."""
        if not self._delay:
            self.drive.follow(position, over, velocity)
        elif self.servo_on:
            self._on_the_way.append((self.time + self._delay, (position, over, velocity)))

    def servo(self, on: bool) -> None:
        """Switch the servo; while it is off nothing holds the side, and the springs move it."""
        self._on_the_way.clear()
        if on is not self.servo_on:
            self._gantry.let_go(self._number)
            self.drive.position = self.position  # it begins anew where the side is
            self.drive.servo(False)
            self.pace = 0.0
        self.servo_on = on
        if on:
            self.drive.servo(True)

    def step(self, dt: float) -> Sequence[Happening]:
        """Advance the gantry, where no other side has, and return what happened on this side.

        All sides must take the same steps, one after the other; give them their setpoints before.
        """
        if self.time == self._gantry.time:
            self._gantry.advance(dt)
        self.time = self._gantry.time
        return self._happened

    # ---------------------------------------------------------------------- what the gantry does

    def drive_on(self, dt: float) -> None:
        """Advance the drive by a step."""
        while self._on_the_way and self._on_the_way[0][0] <= self.time + ROUNDING:
            self.drive.follow(*self._on_the_way.popleft()[1])
        before = self.drive.position
        self.drive.step(dt)
        self.pace = (self.drive.position - before) / dt

    def settle(self, dt: float, off: float) -> bool:
        """End a step ``off`` beside the drive; return whether a hard stop holds the side."""
        before = self.position
        after = self.drive.position + off
        stopped = not self._low <= after <= self._high
        if stopped:
            after = min(max(after, self._low), self._high)
        self.position = after
        self._happened = (
            NOTHING
            if self._quiet_low < after < self._quiet_high or after == before
            else self._happenings(self.time, dt, before, after)
        )
        return stopped


class Gantry:
    """The sides of a gantry, by their full names: the leader first."""

    def __init__(
        self,
        axis: str,
        layout: AxisLayout,
        positions: Mapping[str, float] | None = None,
        friction: float = FRICTION,
    ) -> None:
        """Put the gantry at rest; its drives hold it.

        Args:
            axis: The name of the axis, which is the leader's.
            layout: Its layout, with those of the followers.
            positions: Where sides stand; the others stand where their layouts say.
            friction: How fast sides whose servo is off slow down, 1/s.

        Raises:
            ValueError: A position is beyond a hard stop.
        """
        layouts = {axis: layout, **layout.followers}
        at = positions or {}
        self.time = 0.0
        self.sides: dict[str, Side] = {}
        for number, (name, one) in enumerate(layouts.items()):
            try:
                self.sides[name] = Side(self, number, one, at.get(name))
            except ValueError as error:
                raise ValueError(f'{name}: {error}') from None
        self._all = tuple(self.sides.values())
        self._square = [one.square_at for one in layout.followers.values()]
        self._stiffness = [one.stiffness for one in layout.followers.values()]
        masses = [one.mass for one in layouts.values()]
        self._racking = Racking(masses, self._stiffness, friction)
        self._state = self._racking.rest(self.racked)  # along the leader's encoder

    @property
    def racked(self) -> list[float]:
        """How far each follower is ahead of the leader, less what is square, m."""
        return self._ahead([side.position for side in self._all])

    @property
    def forces(self) -> list[float]:
        """What the spring of each follower bears, N: its stiffness times how far it is ahead."""
        return [k * by for k, by in zip(self._stiffness, self.racked, strict=True)]

    @property
    def speeds(self) -> list[float]:
        """How fast each side goes, m/s, along the leader's encoder."""
        return [
            side.sign * side.pace + speed
            for side, speed in zip(self._all, self._state[1::3], strict=True)
        ]

    @property
    def momentum(self) -> float:
        """The momentum of all sides together, kg m/s, along the leader's encoder."""
        return sum(m * v for m, v in zip(self._racking.masses, self.speeds, strict=True))

    @property
    def energy(self) -> float:
        """What the sides and the springs have in them, J."""
        moved = (m * v * v for m, v in zip(self._racking.masses, self.speeds, strict=True))
        strained = (k * by * by for k, by in zip(self._stiffness, self.racked, strict=True))
        return 0.5 * (sum(moved) + sum(strained))

    def advance(self, dt: float) -> None:
        """Advance all sides by ``dt`` s; a side's step calls it."""
        sides, state = self._all, self._state
        before = self._ahead([side.drive.position for side in sides])
        for side in sides:
            side.drive_on(dt)
        after = self._ahead([side.drive.position for side in sides])
        servos = tuple([side.servo_on for side in sides])
        self._state = state = self._racking.step(dt, servos, state, before, after)
        for number, side in enumerate(sides):
            if side.settle(dt, side.sign * state[3 * number]):
                stopped = side.sign * (side.position - side.drive.position)
                state[3 * number : 3 * number + 2] = stopped, -side.sign * side.pace
        self.time += dt

    def let_go(self, number: int) -> None:
        """Let the drive of a side begin anew where the side is; the side keeps its speed."""
        side, state = self._all[number], self._state
        speed = state[3 * number + 1] + side.sign * side.pace
        state[3 * number : 3 * number + 3] = 0.0, speed, 0.0

    def _ahead(self, positions: Sequence[float]) -> list[float]:
        """Return how far followers are ahead of the leader, less what is square."""
        leader = positions[0]
        return [
            side.sign * position - leader - square
            for side, position, square in zip(
                self._all[1:], positions[1:], self._square, strict=True
            )
        ]


Plant = SimulatedAxis | Side


def plants(layouts: Mapping[str, AxisLayout]) -> dict[str, Plant]:
    """Return what simulates each axis and each follower, by their full names."""
    found: dict[str, Plant] = {}
    for name, layout in layouts.items():
        if layout.followers:
            found.update(Gantry(name, layout).sides)
        else:
            found[name] = SimulatedAxis(layout)
    return found
