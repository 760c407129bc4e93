# SPDX-License-Identifier: Apache-2.0
"""Jerk-limited setpoints of one axis.

A motion is planned as a whole when it is ordered: a path of pieces of constant jerk. Searches and
stops use ruckig's velocity interface, moves its position interface. Everything is in the axis's
*toward* frame: positive along the homing direction. Units: m or rad, s.

A controller is told in advance (:meth:`Profile.announce`): the plan up to a horizon, and a stop to
rest after that. Where cycles are missed for longer than the horizon, the controller is on that
stop, and :meth:`Profile.skip` lets the plan go on from there.
"""

from collections.abc import Callable
from copy import copy
from functools import partial, wraps
from typing import Concatenate, NamedTuple, ParamSpec

from .path import SAME_TIME, Piece, Stop, state_at, until
from .phase import Dynamics, NoTrajectory, Phase, pieces_of, to_velocity

#: Below this a velocity or a distance is ruckig's rounding, not a motion.
TINY = 1e-12
#: How long the path is remembered, s: a message of the feedback may be so late (travel.py).
REMEMBERED = 0.15
#: A command whose drive is off goes back to where the axis is: it brakes within this time, s.
BACK = 0.02
#: A pause of single setpoints up to this long is a late setpoint; after a longer one the axis has
#: stood still, s.
STOOD_STILL = 0.01


class Order(NamedTuple):
    """What a motion is for: to keep a velocity, or to reach a position."""

    dynamics: Dynamics
    velocity: float = 0.0
    position: float | None = None


Given = ParamSpec('Given')


def _order(
    method: Callable[Concatenate['Profile', Given], None],
) -> Callable[Concatenate['Profile', Given], None]:
    """Remember an order until the next update; see :meth:`Profile.skip`."""

    @wraps(method)
    def ordered(self: 'Profile', /, *args: Given.args, **kwargs: Given.kwargs) -> None:
        self.remember(partial(method, self, *args, **kwargs))
        method(self, *args, **kwargs)

    return ordered


class Profile:
    """The commanded position, velocity and acceleration of one axis, a cycle at a time.

    ``position``, ``velocity`` and ``acceleration`` are the newest command; what is ordered acts
    from there on. ``done`` tells that the last motion has reached its velocity or target;
    ``dynamics`` are those in use.

    The newest command is ``lead`` s ahead of the present (0: not), so that a controller hears of a
    change of the plan before it comes to it. Only :meth:`freeze` and :meth:`stop_from` act at the
    present.
    """

    __slots__ = (
        'position',
        'velocity',
        'acceleration',
        'done',
        'period',
        'dynamics',
        'lead',
        '_time',
        '_pieces',
        '_changes',
        '_order',
        '_announced',
        '_orders',
        '_before',
        '_tail',
        '_tail_of',
        '_problem',
        '_max_jerk',
    )

    def __init__(
        self, period: float, max_jerk: float, position: float = 0.0, lead: float = 0.0
    ) -> None:
        self.period = period
        self.lead = lead
        self._max_jerk = max_jerk
        self.dynamics = Dynamics(1.0, 1.0, 1.0)
        self._changes: list[tuple[float, Dynamics]] = []  # when other dynamics come into use
        self._order: Order | None = None  # what the motion is for; None: to rest
        self._tail: list[Piece] = []  # of a stop that begins at time and position 0
        self._tail_of: tuple[float, ...] = ()  # what that stop begins with
        self.reset(position)

    def reset(self, position: float) -> None:
        """Set the command to a position at rest."""
        self._time = 0.0  # of the newest command
        self._pieces: list[Piece] = []
        self._announced: Stop | None = None  # what the controller was told last
        self._orders: list[Callable[[], None]] = []  # since the last update
        self._before: Profile | None = None  # as it was before them
        self._rest(0.0, position)

    @_order
    def seek(self, velocity: float, dynamics: Dynamics) -> None:
        """Go to a velocity (signed) and keep it.

        A reversal is one continuous trajectory through zero with min(acceleration, deceleration)
        of the dynamics that the axis leaves; where the new ones accelerate more gently than that,
        they take over at rest. Slowing down uses the deceleration of those that the axis leaves.
        """
        self._order = Order(dynamics, velocity)
        old, now = self.dynamics, self.velocity
        if now * velocity < 0.0:
            limit = min(old.acceleration, old.deceleration)
            if dynamics.acceleration < limit:
                self._plan(Phase(old, limit, limit, 0.0), _from_rest(self._order))
            else:
                self._plan(Phase(dynamics, limit, limit, velocity))
        elif abs(velocity) < abs(now) - TINY:
            slower = to_velocity(old, dynamics.acceleration, old.deceleration, velocity, now)
            self._plan(slower, slower._replace(dynamics=dynamics))
        else:
            _, acceleration, deceleration = dynamics
            self._plan(to_velocity(dynamics, acceleration, deceleration, velocity, now))

    @_order
    def stop(self, deceleration: float | None = None) -> None:
        """Come to rest with a deceleration, by default the one of the present dynamics."""
        if self.velocity == 0.0 and self.acceleration == 0.0:
            self._rest(self._time, self.position)
            return
        limit = self.dynamics.deceleration if deceleration is None else deceleration
        self._order = None
        self._plan(Phase(self.dynamics, limit, limit, 0.0))

    @_order
    def stop_from(self, position: float, velocity: float, deceleration: float) -> None:
        """Come to rest from where the axis is at present, wherever the command is."""
        newest, self._time = self._time, self._time - self.lead
        self.position, self.velocity, self.acceleration = position, velocity, 0.0
        self._order = None
        self._plan(Phase(self.dynamics, deceleration, deceleration, 0.0))
        self._go_to(newest)

    @_order
    def brake_harder(self, deceleration: float) -> None:
        """Brake with at least this deceleration on the way to a stop or a reversal.

        A stop that comes meanwhile is no gentler.
        """
        then, old = self._order, self.dynamics
        limit = max(deceleration, old.deceleration)
        stop = Phase(old._replace(deceleration=limit), limit, limit, 0.0)
        if then is not None and then.position is None:
            self._plan(stop, _from_rest(then))
        else:
            self._order = None
            self._plan(stop)

    @_order
    def move(self, target: float, dynamics: Dynamics) -> None:
        """Go to a position and rest there."""
        self._order = Order(dynamics, dynamics.velocity, target)
        _, acceleration, deceleration = dynamics
        forward = target >= self.position
        up, down = (acceleration, deceleration) if forward else (deceleration, acceleration)
        self._plan(Phase(dynamics, up, down, dynamics.velocity, target))

    @_order
    def freeze(self) -> None:
        """Stop at once, with infinite deceleration."""
        begin = self._time - self.lead
        self._rest(begin, self.present)

    @_order
    def come_back(self, position: float) -> None:
        """Go to where the axis is, quickly and without a step, because its drive is off.

        The limits do not hold: should the drive come back on, the command must be there.
        """
        speed, distance = abs(self.velocity), abs(self.position - position)
        limit = max(*self.dynamics[1:], speed / BACK)
        fastest = max(speed, distance / BACK, self.dynamics.velocity)
        self._order = None
        back = Phase(self.dynamics, limit, limit, fastest, position)
        self._plan(back, jerk=max(self._max_jerk, 4.0 * limit / BACK))

    def remember(self, order: Callable[[], None]) -> None:
        """Remember an order that comes before the next update."""
        if not self._orders:
            self._before = copy(self)
        self._orders = [*self._orders, order]

    def stopping_position(self, deceleration: float) -> float:
        """Return where a stop that begins now would end."""
        state = self.position, self.velocity, self.acceleration
        stop = Phase(self.dynamics, deceleration, deceleration, 0.0)
        *_, end = pieces_of(0.0, state, stop, self._max_jerk)
        return end.position

    def shifted(self, by: float) -> 'Profile':
        """Return another profile with the same motion, further by a distance."""
        other = copy(self)
        other.position += by
        other._pieces = [piece.moved(0.0, by) for piece in self._pieces]
        other._changes = list(self._changes)
        other._orders, other._before = [], None
        if self._announced is not None:
            other._announced = self._announced.moved(by)
        order = self._order
        if order is not None and order.position is not None:
            other._order = order._replace(position=order.position + by)
        return other

    @property
    def present(self) -> float:
        """The position that is commanded at present, ``lead`` before the newest."""
        return self.commanded()

    def commanded(self, age: float = 0.0) -> float:
        """Return the position that was commanded ``age`` s before the present."""
        if not (self.lead or age):
            return self.position
        return state_at(self._pieces, self._time - self.lead - age)[0]

    @property
    def arrived(self) -> bool:
        """Whether the motion has reached its velocity or target at present, too."""
        return self._time - self.lead >= self._pieces[-1].time - SAME_TIME

    def update(self) -> None:
        """Advance by one period.

        Raises ArithmeticError where the limits allow no trajectory; the command then stays.
        """
        if self._problem:
            raise ArithmeticError(f'no trajectory: {self._problem}')
        self._go_to(self._time + self.period)
        if self._orders:
            self._orders, self._before = [], None

    # ---------------------------------------------------------------- what a controller is told

    def announce(self, horizon: float) -> tuple[float, list[Piece], Stop]:
        """Return the present, the path from there on that the controller is told, and its stop.

        The path is the plan up to ``horizon`` s from the present; then the axis stops with the
        deceleration in use. Called after :meth:`update`: the present is the time of its cycle,
        a period and ``lead`` before the newest command. The path also tells what lies before.
        """
        present = self._time - self.period - self.lead
        while len(self._pieces) > 1 and self._pieces[1].time < present - REMEMBERED:
            del self._pieces[0]
        pieces, end = self._pieces, present + horizon
        last = pieces[-1]
        if last.velocity == 0.0 and (self._order is None or last.time <= end):
            self._announced = Stop(end, last.position, ())
            return present, list(pieces), self._announced
        dynamics = self.dynamics
        for time, changed in self._changes:
            if time <= end:
                dynamics = changed
        position, velocity, acceleration = state_at(pieces, end)
        start = velocity, acceleration, dynamics.deceleration
        if start != self._tail_of:
            limit = dynamics.deceleration
            stop = Phase(dynamics, limit, limit, 0.0)
            begin = 0.0, velocity, acceleration
            self._tail = list(pieces_of(0.0, begin, stop, self._max_jerk))
            self._tail_of = start
        self._announced = Stop(end, position, self._tail)
        return present, until(pieces, end), self._announced

    def skip(self, elapsed: float) -> None:
        """Let a time pass in which there was no cycle: the controller followed what it was told.

        A controller that is told single setpoints stood still meanwhile. The plan goes on where it
        was: from rest, unless the pause was so short that the axis has hardly slowed down. Orders
        since the last update, of which the controller knows nothing, act after the pause.
        """
        orders, before = self._orders, self._before
        if before is None:
            self._skip(elapsed)
            return
        for name in self.__slots__:
            setattr(self, name, getattr(before, name))
        self._skip(elapsed)
        for order in orders:
            order()

    def _skip(self, elapsed: float) -> None:
        told, order = self._announced, self._order
        if told is None:
            if elapsed <= STOOD_STILL:
                return
            self._rest(self._time, self.position)
        else:
            time = self._time + elapsed
            if not told.pieces or time <= told.time:
                self._go_to(time)
                return
            self._pieces = until(self._pieces, told.time) + told.path()
            self._changes = []
            self._go_to(time)
        if order is None:
            return
        if order.position is None:
            self.seek(order.velocity, order.dynamics)
        else:
            self.move(order.position, order.dynamics)

    # ---------------------------------------------------------------------------------- inside

    def _rest(self, time: float, position: float) -> None:
        """Rest at a position from a time on."""
        self._pieces = [*until(self._pieces, time), Piece(time, position, 0.0, 0.0, 0.0)]
        self._changes, self._order, self._problem = [], None, ''
        self._go_to(self._time)

    def _go_to(self, time: float) -> None:
        """Take the command of a time of the path."""
        self._time = time
        last = self._pieces[-1]
        self.done = time >= last.time - SAME_TIME
        if self.done:
            self.velocity, self.acceleration = last.velocity, 0.0
            self.position = last.position + last.velocity * (time - last.time)
        else:
            self.position, self.velocity, self.acceleration = state_at(self._pieces, time)
        while self._changes and time >= self._changes[0][0] - SAME_TIME:
            _, self.dynamics = self._changes.pop(0)

    def _plan(self, *phases: Phase, jerk: float = 0.0) -> None:
        """Replace the plan from the newest command on; ``jerk`` 0: the axis's."""
        time = self._time
        state = self.position, self.velocity, self.acceleration
        pieces, changes = until(self._pieces, time), []
        try:
            for phase in phases:
                changes.append((time, phase.dynamics))
                *stretch, last = pieces_of(time, state, phase, jerk or self._max_jerk)
                pieces += stretch
                time, *state_then = last
                state = state_then[0], state_then[1], state_then[2]
        except NoTrajectory as error:
            self._problem = str(error)
            return
        self._problem = ''
        self._pieces, self._changes = [*pieces, last], changes
        self._go_to(self._time)


def _from_rest(order: Order) -> Phase:
    """Accelerate from rest to an order's velocity."""
    _, acceleration, deceleration = order.dynamics
    return to_velocity(order.dynamics, acceleration, deceleration, order.velocity, 0.0)
