# SPDX-License-Identifier: Apache-2.0
"""Disturbances between a machine and the node, as functions of messages.

A disturbance takes every message on its way (an input's level or latch, a feedback sample, a
setpoint) and yields what becomes of it: nothing, the same message, another one, several.
:class:`DisturbedRehearsal` homes an axis through any number of disturbances. There is no clock:
all times are those of the messages, s.
"""

import heapq
import random
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

from ..core.axis import Setpoint
from ..core.stamps import REORDERED, Stamps, too_late
from ..course import Happening
from ..parameters.axis import AxisParameters
from ..plant.drivers import LONG_AGO
from ..plant.layout import AxisLayout
from ..procedures.states import LATCHES, Error, Input
from .link import DIRECT, PLANT_STEP, Transport
from .run import Rehearsal

#: The topics that are no input of an axis: positions, raw.
FEEDBACK = 'feedback'
SETPOINT = 'setpoint'


class Message(NamedTuple):
    """A message on its way: when it was sent, its stamp, and how long it travels; all in s."""

    topic: str
    sent: float
    stamp: float
    value: bool | float
    delay: float = 0.0


Disturbance = Callable[[Message], Iterable[Message]]


class Moment:
    """When a disturbance begins: at the first feedback sample for which a condition holds.

    ``time`` and ``position`` are those of that sample, NaN before it came.
    """

    def __init__(self, condition: Callable[[float, float], bool]) -> None:
        self._condition = condition
        self.come = False
        self.time = self.position = float('nan')

    def look(self, message: Message) -> bool:
        """Look at a message; return whether the moment has come."""
        if not self.come and message.topic == FEEDBACK:
            self.come = self._condition(message.sent, message.value)
            if self.come:
                self.time, self.position = message.sent, message.value
        return self.come


def past(position: float, way: int = 1) -> Moment:
    """Return the moment at which the axis comes past a position, going a way."""
    return Moment(lambda _, at: (at - position) * way >= 0.0)


# ------------------------------------------------------------------------------------ switches


def bounces(topic: str, times: int = 3, every: float = 0.0005) -> Disturbance:
    """Let `times` bounces follow every edge, `every` s apart."""

    def change(one: Message) -> Iterable[Message]:
        yield one
        for i in range(2 * times if one.sent > 0.0 else 0):
            at = (i + 1) * every
            yield one._replace(
                sent=one.sent + at, stamp=one.stamp + at, value=bool(one.value) is (i % 2 == 1)
            )

    return of(topic, change)


def noise(
    topic: str, moment: Moment, lasts: float, times: int = 1, every: float = 0.0
) -> Disturbance:
    """Make bursts of the other level without a contact: `times` of `lasts` s, `every` s apart."""
    level, done = False, False

    def disturb(one: Message) -> Iterable[Message]:
        nonlocal level, done
        yield one
        if one.topic == topic:
            level = bool(one.value)
        elif moment.look(one) and not done:
            done = True
            for i in range(times):
                for at, value in ((i * every, not level), (i * every + lasts, level)):
                    yield Message(topic, one.sent + at, one.sent + at, value)

    return disturb


def stuck(topic: str, level: bool) -> Disturbance:
    """Hold the level."""
    return of(topic, lambda one: [one._replace(value=level)])


def sticks(topic: str, level: bool) -> Disturbance:
    """Hold the switch at its first edge to a level."""
    stays = False

    def change(one: Message) -> Iterable[Message]:
        nonlocal stays
        if not stays:
            yield one
        stays = stays or (one.value is level and one.sent > 0.0)

    return of(topic, change)


def swapped(one: str, other: str) -> Disturbance:
    """Swap the wires of two inputs."""
    names = {one: other, other: one}
    return lambda message: [message._replace(topic=names.get(message.topic, message.topic))]


def inverted(topic: str) -> Disturbance:
    """Invert the level."""
    return of(topic, lambda one: [one._replace(value=not one.value)])


def repeated(topic: str, every: float, until: Moment | None = None) -> Disturbance:
    """Publish the level again every `every` s, until a moment."""
    level: bool | float | None = None
    last = 0.0

    def disturb(one: Message) -> Iterable[Message]:
        nonlocal level, last
        yield one
        ended = until is not None and until.look(one)
        if one.topic == topic:
            level = one.value
        due = one.topic == FEEDBACK and one.sent - last >= every
        if due and level is not None and not ended:
            last = one.sent
            yield Message(topic, one.sent, one.sent, level)

    return disturb


# ------------------------------------------------------------------------------------ messages


def lost(topic: str, moment: Moment | None = None, count: float = inf) -> Disturbance:
    """Lose the first `count` messages after a moment; the messages at the start arrive."""
    left = count

    def change(one: Message) -> Iterable[Message]:
        nonlocal left
        if one.sent > 0.0 and left > 0:
            left -= 1
        else:
            yield one

    return of(topic, change, moment)


def late(topic: str, by: float, moment: Moment | None = None) -> Disturbance:
    """Delay messages by `by` s more."""
    return of(topic, lambda one: [one._replace(delay=one.delay + by)], moment)


def jitters(topic: str, most: float, seed: int = 0) -> Disturbance:
    """Delay each message by a random time, so that messages overtake each other."""
    chance = random.Random(seed)
    return of(topic, lambda one: [one._replace(delay=one.delay + chance.uniform(0.0, most))])


def duplicated(topic: str, after: float) -> Disturbance:
    """Deliver every message a second time, `after` s later."""
    return of(topic, lambda one: [one, one._replace(delay=one.delay + after)])


def clock_jumps(topic: str, by: float, moment: Moment | None = None) -> Disturbance:
    """Let the publisher's clock jump by `by` s, and its stamps with it."""
    return of(topic, lambda one: [one._replace(stamp=one.stamp + by)], moment)


# --------------------------------------------------------------------- feedback, drive, latches


def frozen(moment: Moment) -> Disturbance:
    """Publish the feedback on and on with the value that it had at a moment."""
    return of(FEEDBACK, lambda one: [one._replace(value=moment.position)], moment)


def scaled(topic: str, factor: float) -> Disturbance:
    """Let positions go a multiple of the way from the first one.

    Of the feedback, -1: the encoder is inverted. Of the setpoints, -1: the drive; 0.5: it slips.
    """
    start: float | None = None

    def change(one: Message) -> Iterable[Message]:
        nonlocal start
        start = one.value if start is None else start
        yield one._replace(value=start + factor * (one.value - start))

    return of(topic, change)


def stands(moment: Moment, lasts: float = inf) -> Disturbance:
    """Let the axis stand for `lasts` s, whatever the setpoints are."""
    return of(SETPOINT, lambda one: [one] if one.sent > moment.time + lasts else [], moment)


def no_encoder() -> Disturbance:
    """Let the drive report its command as the feedback."""
    command: float | None = None

    def disturb(one: Message) -> Iterable[Message]:
        nonlocal command
        if one.topic == SETPOINT:
            command = one.value
        elif one.topic == FEEDBACK and command is not None:
            one = one._replace(value=command)
        yield one

    return disturb


def loses_steps(moment: Moment, by: float) -> Disturbance:
    """Let the axis be off by `by` m from a moment on."""
    return of(SETPOINT, lambda one: [one._replace(value=one.value + by)], moment)


def doubled(topic: str, by: float) -> Disturbance:
    """Deliver every latch a second time, off by `by` m."""
    return of(topic, lambda one: [one, one._replace(value=one.value + by)])


def of(
    topic: str, change: Callable[[Message], Iterable[Message]], moment: Moment | None = None
) -> Disturbance:
    """Return a disturbance of one topic, from a moment on."""

    def disturb(one: Message) -> Iterable[Message]:
        begun = moment is None or moment.look(one)
        return change(one) if begun and one.topic == topic else (one,)

    return disturb


# ------------------------------------------------------------------------------------- the run


class DisturbedRehearsal(Rehearsal):
    """A rehearsal whose messages pass through disturbances; it judges stamps as the node does.

    Attributes:
        decided: where the plant was when the run began to end with an error, m; None before.
        low, high: the range in which the plant moved, m.
    """

    def __init__(
        self,
        parameters: AxisParameters,
        layout: AxisLayout,
        disturbances: Sequence[Disturbance] = (),
        transport: Transport = DIRECT,
    ) -> None:
        self._disturbances = disturbances
        self._stamps = {FEEDBACK: Stamps(parameters.feedback_timeout, REORDERED)}
        for source in parameters.inputs:
            self._stamps[source.value] = Stamps(parameters.feedback_timeout)
        self.decided: float | None = None
        super().__init__(parameters, layout, transport)
        self.low = self.high = self.plant.position

    def cycle(self) -> Setpoint | None:
        setpoint = super().cycle()
        machine, position = self.axis.machine, self.plant.position
        self.low, self.high = min(self.low, position), max(self.high, position)
        if machine is not None and machine.ending.stopping and self.decided is None:
            self.decided = position
        return setpoint

    def hold_up(self, seconds: float, cycle_timeout: float = 0.2) -> None:
        """Let the node stand still; then its cycle goes on as the node's does (ros/node.py)."""
        self._pass_time(round(seconds / PLANT_STEP))
        if seconds - self.period > cycle_timeout:
            self.axis.stop(Error.CycleLate, f'a control cycle was {seconds:.3f} s late')

    def _introduce(self) -> None:
        for name, level in self.plant.levels().items():
            self._post(Message(name, LONG_AGO, LONG_AGO, level))
        self._send_feedback(0.0, self.plant.position)
        self.deliver(self.time)

    def _report(self, happening: Happening) -> None:
        t = self.transport
        delay = t.latch_delay if Input(happening.input) in LATCHES else t.switch_delay
        self._post(
            Message(happening.input, happening.time, happening.time, happening.value, delay)
        )

    def _send_feedback(self, time: float, position: float) -> None:
        self._post(Message(FEEDBACK, time, time, position, self.transport.feedback_delay))

    def _command(self, position: float) -> None:
        self._post(Message(SETPOINT, self.time, self.time, position))
        self.deliver(self.time)

    def _post(self, message: Message) -> None:
        messages = [message]
        for disturb in self._disturbances:
            messages = [out for one in messages for out in disturb(one)]
        for one in messages:
            deliver: Callable[[float], None] = partial(self._take, one)
            heapq.heappush(self._messages, (one.sent + one.delay, next(self._order), deliver))

    def _take(self, one: Message, arrival: float) -> None:
        if one.topic == SETPOINT:
            self.plant.follow(one.value, over=self.period)
        elif one.topic in LATCHES:
            self.axis.latch(Input(one.topic), one.value)
        else:
            stamps = self._stamps.get(one.topic)
            found = stamps.believe(one.stamp, arrival) if stamps else None
            if found is None:
                return
            time, doubt = found
            if stamps is not None and stamps.late:
                error = Error.FeedbackStale if one.topic == FEEDBACK else Error.SwitchStale
                self.axis.stop(error, too_late(one.topic, stamps))
            if one.topic != FEEDBACK:
                self.axis.switch(Input(one.topic), time, bool(one.value), max(arrival, 0.0), doubt)
            elif isfinite(one.value):
                self.axis.feedback(time, one.value, arrival, doubt)
