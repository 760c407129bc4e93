# SPDX-License-Identifier: Apache-2.0
"""How messages travel in a rehearsal, between a drive, its plant and the core."""

import heapq
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from math import isnan, nan
from typing import Any

from ..core.stamps import Stamps
from ..course import Course, Happening
from ..plant.drivers import SwitchDriver
from ..plant.gantry import Plant
from ..procedures.states import LATCHES, Input

#: The plant's step, s.
PLANT_STEP = 0.001


@dataclass(frozen=True)
class Transport:
    """How messages are sent and travel: rates in Hz, times in s.

    Attributes:
        update_rate: cycles of the node; divides 1000 Hz.
        feedback_rate: feedback messages; divides 1000 Hz.
        feedback_delay: from the sampling to the arrival of a feedback message.
        switch_delay: the same of a switch.
        latch_delay: the same of a latched position.
        jitter: every delay is longer by a random part of this; a topic keeps its order.
        seed: of everything random.
        stamp_error: a switch's stamp is late by a random part of this.
        stamp_late: and by this.
        poll_rate: the drivers of the switches read and publish them at this rate; 0: on change.
        heartbeat: drivers that publish on change repeat the level after this time; 0: never.
        period_jitter: by which part of itself the period of either may be longer or shorter.
        lost: part of the messages of switches and of the feedback that never arrive.
        read_rate: the driver of the feedback reads the position at this rate; 0: for each message.
        header_offset: the clock of the feedback's headers is ahead of the clock of its messages by
            this; NaN: the headers are not used.
    """

    update_rate: float = 250.0
    feedback_rate: float = 500.0
    feedback_delay: float = 0.0
    switch_delay: float = 0.0
    latch_delay: float = 0.0
    jitter: float = 0.0
    seed: int = 0
    stamp_error: float = 0.0
    stamp_late: float = 0.0
    poll_rate: float = 0.0
    heartbeat: float = 0.0
    period_jitter: float = 0.0
    lost: float = 0.0
    read_rate: float = 0.0
    header_offset: float = nan


DIRECT = Transport()


class Link:
    """What is between one drive of the core and its plant.

    Attributes:
        axis: the axis, or the follower of a gantry, that gets the messages.
        switched: the one that gets those of the switches; another one if cables are swapped.
        plant: what simulates it.
        course: the record of the run.
    """

    def __init__(self, axis: Any, plant: Plant, transport: Transport, seed: object) -> None:
        """Tell the drive where everything stands; ``seed`` is of everything random."""
        self.axis, self.plant, self.transport = axis, plant, transport
        self.switched = axis
        self.course = Course()
        self._random = random.Random(seed)  # type: ignore[arg-type]
        self._per_feedback = divide(transport.feedback_rate, 'feedback_rate')
        self._steps = 0
        self._order = count()
        self._messages: list[tuple[float, int, Callable[[float], None]]] = []
        self._last_delivery: dict[str, float] = {}
        self._read: tuple[float, float] | None = (
            None  # the driver's newest reading of the position
        )
        self._feedback_stamps = Stamps(axis.parameters.feedback_timeout)
        self._drivers = {
            name: self._driver(name, level) for name, level in self.plant.levels().items()
        }
        self._introduce()

    def step(self, count: int = 1) -> None:
        """Let the plant run for some steps; what it tells is on its way."""
        periodic = self._periodic
        for _ in range(count):
            self._steps += 1
            happenings = self.plant.step(PLANT_STEP)
            for happening in happenings:
                self.course.happenings.append(happening)
                self._report(happening)
            if periodic:
                self._publish_switches(self._steps * PLANT_STEP, happenings)
            if self._steps % self._per_feedback == 0:
                self._send_feedback(self._steps * PLANT_STEP, self.plant.position)

    def deliver(self, now: float) -> None:
        """Give the drive the messages that have come by now."""
        while self._messages and self._messages[0][0] <= now:
            arrival, _, deliver = heapq.heappop(self._messages)
            deliver(arrival)

    @property
    def _periodic(self) -> bool:
        """Whether the drivers of the switches repeat the levels."""
        return bool(self.transport.poll_rate or self.transport.heartbeat)

    def _driver(self, name: str, level: bool) -> SwitchDriver:
        t = self.transport
        period = 1.0 / t.poll_rate if t.poll_rate else t.heartbeat
        return SwitchDriver(level, period, bool(t.poll_rate), t.period_jitter, (t.seed, name))

    def _introduce(self) -> None:
        """Tell the axis where everything stands."""
        for name, driver in self._drivers.items():
            for time, level in driver.past():
                self.axis.switch(Input(name), time, level, 0.0)
        self.axis.feedback(0.0, self.plant.position)

    def _report(self, happening: Happening) -> None:
        time, source, value = happening.time, Input(happening.input), happening.value
        if source in LATCHES:
            self._send(
                source,
                time + self.transport.latch_delay,
                lambda arrival: self.axis.latch(source, float(value)),
            )
        elif not self._periodic:
            self._send_switch(source, time, bool(value))

    def _publish_switches(self, until: float, happenings: Sequence[Happening]) -> None:
        """Let the drivers that repeat the levels publish them."""
        for name, driver in self._drivers.items():
            changes = [(one.time, bool(one.value)) for one in happenings if one.input == name]
            for time, level in driver.step(until, changes):
                self._send_switch(Input(name), time, level)

    def _send_switch(self, source: Input, time: float, level: bool) -> None:
        t = self.transport
        stamp = time + t.stamp_late + self._random.uniform(0.0, t.stamp_error)
        self._send(
            source,
            stamp + t.switch_delay,
            lambda arrival: self.switched.switch(source, stamp, level, arrival),
        )

    def _send_feedback(self, time: float, position: float) -> None:
        t = self.transport
        if t.read_rate:
            if self._read is None or time - self._read[0] >= 1.0 / t.read_rate - 1e-9:
                self._read = time, position
            position = self._read[1]
        if t.feedback_delay == t.jitter == t.lost == 0.0 and isnan(t.header_offset):
            self.axis.feedback(time, position)
        else:
            self._send(
                'feedback',
                time + t.feedback_delay,
                lambda arrival: self._take_feedback(time, position, arrival),
            )

    def _take_feedback(self, time: float, position: float, arrival: float) -> None:
        """Give a feedback message to the axis; judge its header as the node does."""
        offset = self.transport.header_offset
        if isnan(offset):
            self.axis.feedback(time, position, arrival)
            return
        clock = self.axis.parameters.feedback_clock
        found = self._feedback_stamps.believe(time + offset, arrival, time, clock)
        if found is not None:
            self.axis.feedback(found[0], position, arrival, found[1])
            if found[1]:
                self.axis.warn(f'joint_states: {self._feedback_stamps.warning}')

    def _send(self, topic: str, due: float, deliver: Callable[[float], None]) -> None:
        lost = 0.0 if topic in LATCHES else self.transport.lost
        if lost and self._random.random() < lost:
            return
        if self.transport.jitter:
            due += self._random.uniform(0.0, self.transport.jitter)
        due = max(due, self._last_delivery.get(topic, 0.0))
        self._last_delivery[topic] = due
        heapq.heappush(self._messages, (due, next(self._order), deliver))


def divide(rate: float, name: str) -> int:
    """Return how many steps of the plant there are in a period of a rate."""
    steps = round(1.0 / (rate * PLANT_STEP))
    if steps < 1 or abs(steps * rate * PLANT_STEP - 1.0) > 1e-9:
        raise ValueError(f'{name}: {rate:g} Hz must divide {1.0 / PLANT_STEP:g} Hz')
    return steps
