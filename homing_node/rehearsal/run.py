# SPDX-License-Identifier: Apache-2.0
"""Home an axis without ROS: the core against the simulated plant, with a message transport.

Used by the tests, the figures of the documentation and `homing run`. Time is simulated; a run of
seconds takes milliseconds.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ..core.axis import Axis, Setpoint
from ..core.jog import Jog
from ..core.outcome import Outcome
from ..course import Course, Sample
from ..parameters.axis import AxisParameters
from ..plant.gantry import Plant
from ..plant.layout import AxisLayout
from ..plant.simulated_axis import SimulatedAxis
from ..procedures.states import Error
from .link import DIRECT, PLANT_STEP, Link, Transport, divide


class Rehearsal(Link):
    """One axis, its plant and the messages between them, in simulated time."""

    axis: Axis

    def __init__(
        self,
        parameters: AxisParameters,
        layout: AxisLayout,
        transport: Transport = DIRECT,
        position: float | None = None,
    ) -> None:
        self.period, self.time = 1.0 / transport.update_rate, 0.0
        self._per_cycle = divide(transport.update_rate, 'update_rate')
        axis, plant = self._made(parameters, layout, position)
        super().__init__(axis, plant, transport, transport.seed)

    def _made(
        self, parameters: AxisParameters, layout: AxisLayout, position: float | None
    ) -> tuple[Axis, Plant]:
        """Return the axis and its plant."""
        return Axis('x', parameters, self.period), SimulatedAxis(layout, position)

    @property
    def drives(self) -> Mapping[str, Any]:
        """What gets the messages: the axis, of a gantry the followers, too."""
        return {self.axis.name: self.axis}

    def cycle(self) -> Setpoint | None:
        """Let the plant run for one period, deliver what is due, update the axis."""
        self._pass_time(self._per_cycle)
        self.deliver(self.time)
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
        return self._run(self.axis.home, limit)

    def jog(self, jog: Jog, limit: float = 1e4) -> Course:
        """Jog the axis and run until it has ended; the rest is as in :meth:`home`."""
        return self._run(partial(self.axis.jog, jog=jog), limit)

    def _run(self, start: Callable[[float], Outcome | None], limit: float) -> Course:
        """Start a run as soon as the axis rests, and let it end."""
        self._begin_course()
        for _ in range(5):
            self.cycle()
        patience = self.time + self.axis.parameters.rest_timeout
        refusal = start(self.time)
        while refusal and refusal.error is Error.AxisMoving and self.time < patience:
            self.cycle()
            refusal = start(self.time)
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
        self.course.outcome = self.axis.ended
        if machine is not None:
            self.course.arrows = machine.arrows
        return self.course

    def _begin_course(self) -> None:
        self.course = Course()

    def _pass_time(self, steps: int) -> None:
        """Let the plant run; what it tells is on its way."""
        self.step(steps)
        self.time = self._steps * PLANT_STEP

    def _command(self, position: float) -> None:
        self.plant.follow(position, over=self.period)


def rehearse(
    parameters: AxisParameters,
    layout: AxisLayout,
    transport: Transport = DIRECT,
    position: float | None = None,
) -> Course:
    """Home one axis once and return the course."""
    return Rehearsal(parameters, layout, transport, position).home()
