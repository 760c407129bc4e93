# SPDX-License-Identifier: Apache-2.0
"""The home of an axis after its run: handed over to the machine, watched, and lost."""

from ..parameters.axis import AxisParameters
from ..procedures.states import Apply, Error
from .handover import Handover, Plan
from .handover_steps import Step
from .home_watch import HomeWatch
from .kept_home import KeptHome, RunKind
from .outcome import Outcome
from .settling import Rest

#: A controller may move the axis by this many times `apply_tolerance` when it becomes active.
HOLD = 10.0


class AxisHome(KeptHome):
    """An axis whose home is handed over and watched.

    Attributes:
        free: whether every other axis lets a hand-over begin; who hands over sets it.
    """

    def __init__(self, name: str, parameters: AxisParameters) -> None:
        super().__init__(name, parameters)
        self.free = False
        self._rest: Rest | None = None  # where the last run has left the axis
        self._home_watch = HomeWatch()

    def feedback_source_changed(self) -> None:
        """Take that another publisher sends the feedback: a driver that has restarted."""
        text = 'the publisher of the feedback has changed: did the driver restart?'
        if self.handover is not None:
            self.handover.stop(Error.HandoverFailed, text)
        elif self.parameters.clear_home_done_on_comm_stop:
            self._lose_home(Error.HomeLost, text)

    def accept(self) -> Outcome | None:
        """Take the home that has moved, and hand it over; return it, None if there is none."""
        found = super().accept()
        if found is not None and self._hands_home_over:
            self._begin_handover(found)
        return found

    def _begin_handover(self, found: Outcome) -> None:
        p = self.parameters
        self.homed = self.free = False
        self.handover = Handover(
            Plan(
                self.name,
                found,
                p.switch_controllers,
                p.apply_timeout,
                p.apply_agreement,
                HOLD * p.apply_agreement,
                p.apply is Apply.service,
                self.applied,
                p.wrap,
            )
        )

    def _hand_over(self, handover: Handover, now: float) -> None:
        """Follow the hand-over; end the run with it."""
        readings = self.readings
        if not readings.feedback_is_fresh(now) and handover.step not in (Step.Apply, Step.See):
            age = now - readings.arrival
            handover.stop(Error.HandoverFailed, f'the feedback is {age:.3f} s old')
        rests = readings.motion() is None
        handover.update(now, self.raw_position, readings.track.time, rests, self.free)
        if handover.outcome is None:
            return
        self.handover, self.applied = None, handover.applied
        if handover.plan.shifts:
            self._rest = None
            readings.forget_places()
            self.remembered = None
        self.outcome, self.homed = handover.outcome, handover.outcome.success
        if not self.homed:
            self.history.fails(self.outcome.error)

    def _watch_home(self, time: float) -> None:
        """Compare the newest feedback, sampled at ``time``, with the one before.

        While a run moves the axis, the run itself judges the feedback.
        """
        p, watch, raw = self.parameters, self._home_watch, self.raw_position
        if self.moving:
            watch.follow(time, raw)
            return
        jump = watch.step(time, raw, self.readings.leap, p.ls_dec, p.wrap, self.applied)
        if jump:
            self._take_jump(jump, raw)

    def _watch_age(self, now: float) -> None:
        """Lose the home if no feedback comes any more."""
        p = self.parameters
        if p.clear_home_done_on_comm_stop and not self.readings.feedback_is_fresh(now):
            text = f'no feedback came for {p.feedback_timeout:g} s (feedback_timeout)'
            self._lose_home(Error.FeedbackStale, text)

    def _take_jump(self, jump: float, raw: float) -> None:
        """Take that the feedback has jumped while no run was on."""
        text = f'the feedback jumped by {jump:.6g} m to {raw:.6g} m: did the driver restart?'
        handover = self.handover
        if handover is not None:
            if handover.step not in (Step.Apply, Step.See):
                handover.stop(Error.HandoverFailed, text)
            return
        if self.applied and abs(jump - self.applied) < abs(jump):
            self.applied = 0.0
        self.remembered = None
        if self.homed:
            self._lose_home(Error.HomeLost, text)
            self.readings.forget_places()

    def _end(self, outcome: Outcome) -> None:
        """End the run; hand its home over, if somebody wants it."""
        machine, self.machine = self.machine, None
        self.handover = None
        if self.kind is RunKind.jog:
            self._end_jog(outcome)
            return
        self._end_home(outcome, machine)
        if self._hands_home_over and self.outcome.success and self.kind is not RunKind.verify:
            self._begin_handover(self.outcome)

    @property
    def _hands_home_over(self) -> bool:
        return self.hands_over and self.parameters.apply is not Apply.none

    def _lose_home(self, error: Error, text: str) -> None:
        """Note that the axis no longer knows its home, and why."""
        lost = self.homed
        self.forget_home()
        if not lost:
            return
        self._rest = None
        message = f'axis {self.name}: the home is lost: {self.parameters.unit.in_message(text)}'
        self.outcome = self.outcome._replace(error=error, message=message)
