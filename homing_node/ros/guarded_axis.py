# SPDX-License-Identifier: Apache-2.0
"""An axis whose exceptions end its own run and nothing else; a gantry is one axis."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from ..core.axis import Axis
from ..core.gantry.axis import GantryAxis
from ..core.gantry.follower import Follower
from ..core.jog import Jog
from ..core.outcome import Outcome
from ..parameters.axis import AxisParameters
from ..procedures.states import Error


def _guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    def guarded(self: 'GuardedAxis', *args: Any, **kwargs: Any) -> Any:
        try:
            return method(self, *args, **kwargs)
        except Exception as error:
            self._break_off(error)
            return None

    guarded.__doc__ = method.__doc__
    return guarded


class GuardedAxis(Axis):
    """An axis that ends its run with InternalError if its code raises.

    The first exception of a run starts a stop with `ls_dec`. If that raises too, the run ends at
    once, without a further setpoint.
    """

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        period: float,
        report: Callable[[str, Exception], object],
        lead: float = 0.0,
    ) -> None:
        """Create the axis.

        Args:
            name: The name of the axis.
            parameters: Its parameters.
            period: The period of the cycle, s.
            report: Called with a text and the exception, once for each run that breaks.
            lead: How long before its time a setpoint is told, s.
        """
        super().__init__(name, parameters, period, lead)
        self._report = report
        self._broken_run = -1  # the number of the run that raised last

    feedback = _guarded(Axis.feedback)
    feedback_source_changed = _guarded(Axis.feedback_source_changed)
    switch = _guarded(Axis.switch)
    repeat = _guarded(Axis.repeat)
    latch = _guarded(Axis.latch)
    enable = _guarded(Axis.enable)
    warn = _guarded(Axis.warn)
    cancel = _guarded(Axis.cancel)
    resume = _guarded(Axis.resume)
    deadman = _guarded(Axis.deadman)
    stop = _guarded(Axis.stop)
    cycles_were_missed = _guarded(Axis.cycles_were_missed)
    cycle_was_late = _guarded(Axis.cycle_was_late)
    set_emergency_stop = _guarded(Axis.set_emergency_stop)
    set_servo = _guarded(Axis.set_servo)
    update = _guarded(Axis.update)

    def home(self, now: float, verify: bool = False) -> Outcome | None:
        """Start a run; return why it cannot start, None if it has."""
        return self._started(lambda: super(GuardedAxis, self).home(now, verify))

    def jog(self, now: float, jog: Jog) -> Outcome | None:
        """Start a jog; return why it cannot start, None if it has."""
        return self._started(lambda: super(GuardedAxis, self).jog(now, jog))

    def _started(self, start: Callable[[], Outcome | None]) -> Outcome | None:
        try:
            return start()
        except Exception as error:
            self._break_off(error)
            self.abort(Error.InternalError, repr(error))
            return self.ended

    def _break_off(self, error: Exception) -> None:
        """Stop the run, if one is on; end it at once if it has raised before."""
        first = self._broken_run != self.history.count
        self._broken_run = self.history.count
        self.homed = False
        if first:
            self._report(f'axis {self.name} broke: {error!r}', error)
            with suppress(Exception):
                super().stop(Error.InternalError, repr(error))
                return
        if self.running:
            self.abort(Error.InternalError, repr(error))


class GuardedFollower(Follower):
    """A follower whose exceptions end the run of its gantry."""

    feedback = _guarded(Follower.feedback)
    feedback_source_changed = _guarded(Follower.feedback_source_changed)
    switch = _guarded(Follower.switch)
    repeat = _guarded(Follower.repeat)
    latch = _guarded(Follower.latch)
    enable = _guarded(Follower.enable)
    warn = _guarded(Follower.warn)
    stop = _guarded(Follower.stop)

    def _break_off(self, error: Exception) -> None:
        self._leader._break_off(error)


class GuardedGantry(GuardedAxis, GantryAxis):
    """A gantry that ends its run with InternalError if its code raises."""

    follower_class = GuardedFollower

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        period: float,
        report: Callable[[str, Exception], object],
        lead: float,
        followers: Mapping[str, AxisParameters],
    ) -> None:
        """Create the gantry.

        Args:
            name: The name of the axis.
            parameters: The leader's parameters.
            period: The period of the cycle, s.
            report: Called with a text and the exception, once for each run that breaks.
            lead: How long before its time a setpoint is told, s.
            followers: The parameters of the followers, by their full names.
        """
        GantryAxis.__init__(self, name, parameters, period, lead, followers)
        self._report = report
        self._broken_run = -1

    feedback = _guarded(GantryAxis.feedback)
    feedback_source_changed = _guarded(GantryAxis.feedback_source_changed)
    switch = _guarded(GantryAxis.switch)
    repeat = _guarded(GantryAxis.repeat)
    latch = _guarded(GantryAxis.latch)
    enable = _guarded(GantryAxis.enable)
    warn = _guarded(GantryAxis.warn)
    cancel = _guarded(GantryAxis.cancel)
    resume = _guarded(GantryAxis.resume)
    stop = _guarded(GantryAxis.stop)
    cycles_were_missed = _guarded(GantryAxis.cycles_were_missed)
    cycle_was_late = _guarded(GantryAxis.cycle_was_late)
    set_emergency_stop = _guarded(GantryAxis.set_emergency_stop)
    set_servo = _guarded(GantryAxis.set_servo)
    update = _guarded(GantryAxis.update)
