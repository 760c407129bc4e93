# SPDX-License-Identifier: Apache-2.0
"""The home of an axis: found by a run, taken over from before a restart, verified, accepted."""

from collections.abc import Callable
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.states import Error, HomeType, Restore, TextEnum
from .axis_status import AxisStatus
from .machine import Machine
from .outcome import Outcome
from .remembered import Remembered
from .signals import FINEST


class RunKind(TextEnum):
    """What a run is for."""

    home = 'home'
    rehome = 'rehome'
    verify = 'verify'
    jog = 'jog'


class Ended(NamedTuple):
    """A run that has ended, for who compares it with earlier ones.

    Attributes:
        kind: what it was for.
        outcome: how it ended.
        machine: the run; None if it broke.
        duration: how long it took, s.
        resolution: the finest difference that the feedback shows, m or rad.
    """

    kind: RunKind
    outcome: Outcome
    machine: Machine | None
    duration: float
    resolution: float


#: These find the same place again only if the axis begins at the same place.
NOT_REPEATED = (HomeType.CurrentPos, HomeType.ZPulse)
#: Compares a run with earlier ones, and returns how it ends then.
Judge = Callable[[Ended], Outcome]


class KeptHome(AxisStatus):
    """An axis whose home may come from an earlier run.

    Attributes:
        remembered: where earlier runs have found things, raw, as long as the raw coordinates are
            the same; None if nothing is known.
        kind: what the run in progress is for, or the last one was.
        judge: what compares each run with earlier ones; None: nothing does.
    """

    def __init__(self, name: str, parameters: AxisParameters) -> None:
        super().__init__(name, parameters)
        self.remembered: Remembered | None = None
        self.judge: Judge | None = None
        self.kind = RunKind.home
        self._begun = 0.0
        self._unaccepted: Outcome | None = None  # a home that has moved
        self._before: Outcome | None = None  # the home that a run verifies
        self._jogged: Outcome | None = None  # how the last run has ended, if it was a jog

    @property
    def ended(self) -> Outcome:
        """How the last run has ended, be it a homing run or a jog."""
        return self.outcome if self._jogged is None else self._jogged

    @property
    def wants_verify(self) -> bool:
        """Whether the next home request only verifies the home that was taken over."""
        restored = self.homed and self.home_source == 'restored'
        return restored and self.parameters.restore is Restore.verify

    def unverifiable(self) -> Outcome | None:
        """Return why there is no home that can be verified, None if there is one."""
        if not self.homed:
            return self._failed(Error.NotHomed, 'there is no home to verify: home the axis')
        home_type = self.parameters.home_type
        if home_type in NOT_REPEATED:
            return self._failed(Error.InvalidParameter, f'{home_type} cannot be verified')
        return None

    def restore(self, home: Outcome) -> None:
        """Take over a home from before a restart."""
        self.outcome, self.homed, self.home_source = home, True, 'restored'

    def accept(self) -> Outcome | None:
        """Take the home that has moved; return it, None if there is none."""
        found, self._unaccepted = self._unaccepted, None
        if found is not None:
            self.outcome, self.homed, self.home_source = found, True, 'run'
        return found

    def forget_home(self) -> None:
        """Forget the home, because the axis may have moved unseen."""
        self.homed = False
        self._unaccepted = None

    def forget_coordinates(self) -> None:
        """Forget the home and where things are: raw positions mean something else now."""
        self.forget_home()
        self.remembered = None

    # ------------------------------------------------------------------------------------- inside

    def _begin_home(self, now: float, verify: bool) -> Remembered | None:
        """Note what a run is for; the home of an ordinary run is not known any more.

        Returns:
            Where the run goes quickly, in the *toward* frame; None: it is an ordinary run.
        """
        verify = verify or self.wants_verify
        known = self._known(verify)
        self.kind = RunKind.verify if verify else RunKind.rehome if known else RunKind.home
        self._begun, self._unaccepted, self._jogged = now, None, None
        self._before = self.outcome if verify else None
        if not verify:
            self.homed = False
            self.outcome = Outcome(Error.NoError)
        return known

    def _known(self, verify: bool) -> Remembered | None:
        """Return where a run goes quickly, in the *toward* frame, None if nowhere."""
        known, p = self.remembered, self.parameters
        if known is None and verify:  # homed before a restart, and nothing else is known
            known = Remembered(self.home_position_raw, self.home_position_raw, 0.0)
        if known is None or not (verify or p.rehome):
            return None
        known = known.mirrored(self._sign)
        far = abs(known.approach - self.readings.track.position) > p.search_distance
        return None if far else known

    def _end_jog(self, found: Outcome) -> None:
        """Take the end of a jog: the home stays as it was."""
        self._jogged = found
        self.outcome = self.outcome._replace(
            error=found.error, message=found.message, warnings=found.warnings
        )
        self.history.jogged()

    def _end_home(self, found: Outcome, machine: Machine | None) -> None:
        """Take the home of a run that has ended."""
        lasted = machine.now - self._begun if machine else 0.0
        ended = Ended(self.kind, found, machine, lasted, self.readings.finest)
        outcome = found if self.judge is None else self.judge(ended)
        before, self._before = self._before, None
        if before is not None:
            outcome = self._verified(before, found, outcome.warnings)
        if outcome.error is Error.HomeMoved:
            self._unaccepted = found
        self._remember(ended)
        self.history.add(outcome.error, found.home_position_raw)
        kept = before is not None and outcome.error is Error.Canceled
        if kept and before is not None:  # nothing is known against it
            outcome = before._replace(error=outcome.error, message=outcome.message)
        self.homed = outcome.success or kept
        if before is None:
            self.home_source = 'run'
        elif outcome.success and self.home_source == 'restored':
            self.home_source = 'verified'
        self.outcome = outcome._replace(duration=lasted)

    def _verified(self, before: Outcome, found: Outcome, warnings: tuple[str, ...]) -> Outcome:
        """Return the outcome of a run that has verified a home: the home stays as it was."""
        if not found.success:
            return found
        p = self.parameters
        change = found.home_position_raw - before.home_position_raw
        unsure = found.uncertainty + before.uncertainty
        limit, name = p.home_change_limit, 'home_change_limit'
        if not limit:
            limit, name = p.edge_agreement + unsure, 'edge_tolerance and what is uncertain'
        if abs(change) > limit:
            text = (
                f'axis {self.name}: the home was found {p.unit.length(change, sign=True)} from '
                f'where it was, more than {p.unit.length(limit)} ({name}); look at the switch, '
                f'then home the axis or accept its new home (~/{self.name}/accept_home)'
            )
            return Outcome(Error.HomeMoved, text, warnings=warnings)
        return before._replace(
            error=Error.NoError,
            message='',
            warnings=warnings,
            verified=change,
            verified_uncertainty=max(unsure, FINEST),
            unit=p.unit,
        )

    def _remember(self, ended: Ended) -> None:
        machine, found = ended.machine, ended.outcome
        if machine is None or not found.success:
            return
        approach = machine.seen.approach
        if approach is not None:
            self.remembered = Remembered(
                self._sign * approach.position, found.home_position_raw, found.uncertainty
            )

    def _failed(self, error: Error, text: str) -> Outcome:
        return Outcome(error, f'axis {self.name}: {text}')
