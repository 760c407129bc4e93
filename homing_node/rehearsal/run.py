# SPDX-License-Identifier: Apache-2.0
"""Home an axis without ROS: the core against the simulated plant, with a message transport.

Used by the tests, the figures of the documentation and `homing run`. Time is simulated; a run of
seconds takes milliseconds.
"""

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

from ..core.axis import Axis, Setpoint
from ..course import Course, Happening, Sample
from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..plant.simulated_axis import SimulatedAxis
from ..procedures.states import LATCHES, Input

#: The plant's step, s.
PLANT_STEP = 0.001


@dataclass(frozen=True)
class Transport:
    """How messages travel: rates in Hz, delays in s.

    Every delay is ``delay`` plus a random part of at most ``jitter``; messages of one topic keep
    their order. A switch's stamp is late by a random part of ``stamp_error``. ``update_rate`` and
    ``feedback_rate`` divide 1000 Hz.
    """

    update_rate: float = 250.0
    feedback_rate: float = 500.0
    feedback_delay: float = 0.0
    switch_delay: float = 0.0
    latch_delay: float = 0.0
    jitter: float = 0.0
    seed: int = 0
    stamp_error: float = 0.0


DIRECT = Transport()


class Rehearsal:
    """One axis, its plant and the messages between them, in simulated time."""

    def __init__(
        self,
        parameters: AxisParameters,
        layout: AxisLayout,
        transport: Transport = DIRECT,
        position: float | None = None,
    ) -> None:
        self.plant = SimulatedAxis(layout, position)
        self.transport = transport
        self.period = 1.0 / transport.update_rate
        self.axis = Axis('x', parameters, self.period)
        self.course = Course()
        self.time = 0.0
        self._random = random.Random(transport.seed)
        self._per_cycle = _divide(transport.update_rate, 'update_rate')
        self._per_feedback = _divide(transport.feedback_rate, 'feedback_rate')
        self._steps = 0
        self._order = count()
        self._messages: list[tuple[float, int, Callable[[float], None]]] = []
        self._last_delivery: dict[str, float] = {}
        self._introduce()

    def cycle(self) -> Setpoint | None:
        """Let the plant run for one period, deliver what is due, update the axis."""
        self._pass_time(self._per_cycle)
        self._deliver()
        setpoint = self.axis.update(self.time)
        if setpoint is not None:
            self._command(setpoint[0])
            self.course.samples.append(
                Sample(self.time, str(self.axis.state), *setpoint, self.plant.position)
            )
        return setpoint

    def home(self, limit: float = 1e4) -> Course:
        """Home the axis and run until it has ended; ``limit`` in simulated s.

        Raises TimeoutError where the run has not ended by then.
        """
        self.course = Course()
        for _ in range(5):
            self.cycle()
        refusal = self.axis.home(self.time)
        if refusal is not None:
            self.course.outcome = refusal
            return self.course
        return self.finish(limit)

    def finish(self, limit: float = 1e4) -> Course:
        """Run until the axis has ended its run."""
        machine = self.axis.machine
        end = self.time + limit
        while self.axis.running:
            self.cycle()
            if self.time > end:
                raise TimeoutError(f'the run has not ended within {limit:g} s ({self.axis.state})')
        self.course.outcome = self.axis.outcome
        if machine is not None:
            self.course.arrows = machine.arrows
        return self.course

    def _pass_time(self, steps: int) -> None:
        """Let the plant run; what it tells is on its way."""
        for _ in range(steps):
            self._steps += 1
            for happening in self.plant.step(PLANT_STEP):
                self.course.happenings.append(happening)
                self._report(happening)
            if self._steps % self._per_feedback == 0:
                self._send_feedback(self._steps * PLANT_STEP, self.plant.position)
        self.time = self._steps * PLANT_STEP

    # ----------------------------------------------------------------------------------- messages

    def _introduce(self) -> None:
        """Tell the axis where everything stands."""
        for name, level in self.plant.levels().items():
            self.axis.switch(Input(name), 0.0, level)
        self.axis.feedback(0.0, self.plant.position)

    def _deliver(self) -> None:
        while self._messages and self._messages[0][0] <= self.time:
            arrival, _, deliver = heapq.heappop(self._messages)
            deliver(arrival)

    def _command(self, position: float) -> None:
        self.plant.follow(position, over=self.period)

    def _report(self, happening: Happening) -> None:
        time, source, value = happening.time, Input(happening.input), happening.value
        if source in LATCHES:
            self._send(
                source,
                time + self.transport.latch_delay,
                lambda arrival: self.axis.latch(source, float(value)),
            )
        else:
            stamp = time + self._random.uniform(0.0, self.transport.stamp_error)
            self._send(
                source,
                stamp + self.transport.switch_delay,
                lambda arrival: self.axis.switch(source, stamp, bool(value), arrival),
            )

    def _send_feedback(self, time: float, position: float) -> None:
        t = self.transport
        if t.feedback_delay == 0.0 and t.jitter == 0.0:
            self.axis.feedback(time, position)
        else:
            self._send(
                'feedback',
                time + t.feedback_delay,
                lambda arrival: self.axis.feedback(time, position, arrival),
            )

    def _send(self, topic: str, due: float, deliver: Callable[[float], None]) -> None:
        if self.transport.jitter:
            due += self._random.uniform(0.0, self.transport.jitter)
        due = max(due, self._last_delivery.get(topic, 0.0))
        self._last_delivery[topic] = due
        heapq.heappush(self._messages, (due, next(self._order), deliver))


def _divide(rate: float, name: str) -> int:
    steps = round(1.0 / (rate * PLANT_STEP))
    if steps < 1 or abs(steps * rate * PLANT_STEP - 1.0) > 1e-9:
        raise ValueError(f'{name}: {rate:g} Hz must divide {1.0 / PLANT_STEP:g} Hz')
    return steps


def rehearse(
    parameters: AxisParameters,
    layout: AxisLayout,
    transport: Transport = DIRECT,
    position: float | None = None,
) -> Course:
    """Home one axis once and return the course."""
    return Rehearsal(parameters, layout, transport, position).home()
