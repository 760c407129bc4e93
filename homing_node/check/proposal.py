# SPDX-License-Identifier: Apache-2.0
"""Proposes values: those that the checks call right for an axis and its layout.

Every number comes from a finding. First what is wrong with the wiring is corrected. Then the fast
velocity becomes the largest that no check objects to. Then each bound that is not set gets a value
that is too small on purpose, and what its check calls right is proposed. Units: m or rad, s.
"""

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from math import isfinite, sqrt
from typing import Any, NamedTuple

from ..parameters.axis import DEFINITIONS, AxisParameters
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.motions import Kind, Pace
from ..procedures.procedure import Row
from . import check_axis
from .finding import Finding, Severity, down

#: What a user decides, and no number does.
DECISIONS = frozenset(['home_type', 'home_direction', 'switches', 'repeat'])
#: Bounds and tolerances that follow from the speeds and from where things are, and of what.
BOUNDS: Mapping[str, str] = {
    'max_ls_reverse_distance': 'the way back from the limit switch is shorter',
    'max_hs_on_at_start_reverse_distance': 'the way off the home switch is shorter',
    'max_z_pulse_distance': 'the way to the next index pulse is shorter',
    'following_error': 'at this velocity a drive with this lag stays less behind',
}
#: Parameters whose findings say nothing against a velocity: they are set to suit it.
FOLLOWS_VELOCITY = frozenset(
    [
        *BOUNDS,
        'homing_reverse_distance',
        'max_search_distance',
        'mechanical_end_detection_pos_diff',
        'rehome_velocity',
        'timeout',
        'wrong_direction_distance',
    ]
)
#: The velocities of a run.
VELOCITIES = frozenset(['homing_velocity_fast', 'homing_velocity_slow', 'home_shift_velocity'])
#: Why a fast velocity changes to which no check objects.
FASTEST = 'it may home no faster'
ROOM = 'no check objects to it: there is room behind every switch'
#: A bound that no run keeps, so that its check says what it should be.
TOO_SMALL = 1e-9
#: More corrections than any file needs.
MOST_ROUNDS = 40
#: The slow velocity as a part of the fast one, where none is given that fits.
SLOWER = 0.1
#: A search for a velocity begins at this part of the largest one, to which no check can object.
#: It halves the interval this often: until it is 1 % wide, for the result has two digits.
SLOWEST, HALVINGS = 1e-4, 10
#: How many times faster than allowed the room is judged.
BEYOND = 100.0


class Change(NamedTuple):
    """A parameter that should have another value, and why, in words."""

    name: str
    before: object
    value: object
    why: str


@dataclass(frozen=True)
class Proposal:
    """What is proposed for one axis.

    Attributes:
        parameters: The parameters with all changes.
        changes: The changes, in the order of the reference of the parameters.
        findings: What the checks still find: errors and warnings that no value puts right.
        room: The largest fast velocity that no check objects to, m/s or rad/s: what the room
            behind the switches allows, whatever the drive can do. 0: it is not known where a hard
            stop is; then no higher velocity is proposed.
    """

    parameters: AxisParameters
    changes: tuple[Change, ...]
    findings: tuple[Finding, ...]
    room: float


def propose(
    axis: str,
    parameters: AxisParameters,
    layout: AxisLayout,
    timing: Timing | None = None,
    at_most: float | None = None,
) -> Proposal:
    """Propose the values that the checks call right for one axis.

    Args:
        axis: The name of the axis.
        parameters: Its parameters now.
        layout: Where things are along it.
        timing: How fast messages travel.
        at_most: How fast it may home, m/s or rad/s; None: as fast as it does now.
    """
    return _Search(axis, parameters, layout, timing or Timing()).proposal(at_most)


class _Search:
    """The search for the right values of one axis."""

    def __init__(
        self, axis: str, parameters: AxisParameters, layout: AxisLayout, timing: Timing
    ) -> None:
        self._axis, self._layout, self._timing = axis, layout, timing
        self._first = self._now = parameters
        self._reasons: dict[str, str] = {}

    def proposal(self, at_most: float | None) -> Proposal:
        """Return the proposal; ``at_most`` bounds the fast velocity."""
        self._correct(VELOCITIES | FOLLOWS_VELOCITY)
        now, room = self._now.homing_velocity_fast, 0.0
        at_most = at_most or now
        if all(isfinite(stop) for stop in self._layout.hard_stops):
            room = self._fastest(BEYOND * at_most)
        else:
            at_most = min(at_most, now)
        self._set_velocity(at_most)
        self._correct()
        for name in BOUNDS:
            self._set_bound(name)
        self._correct()
        return Proposal(self._now, self._changes(), tuple(self._serious(self._now)), room)

    def _changes(self) -> tuple[Change, ...]:
        return tuple(
            Change(name, before, value, self._reasons[name])
            for name in DEFINITIONS
            if (before := getattr(self._first, name)) != (value := getattr(self._now, name))
        )

    def _serious(self, parameters: AxisParameters) -> list[Finding]:
        """Return the errors and the warnings, the worst first."""
        found = check_axis(self._axis, parameters, self._layout, self._timing)
        return [one for one in found if one.severity is not Severity.info]

    def _set(self, why: str, **values: object) -> bool:
        """Take values, unless they contradict others; return whether they are taken."""
        try:
            good = {name: DEFINITIONS[name].convert(value) for name, value in values.items()}
        except ValueError:
            return False
        changed = replace(self._now, **good)
        if not set(changed.cross_check()) <= set(self._now.cross_check()):
            return False
        self._now = changed
        self._reasons |= dict.fromkeys(values, why)
        return True

    # -------------------------------------------------------------------------------- corrections

    def _correct(self, but: frozenset[str] = frozenset()) -> None:
        """Do what the checks ask for, the worst first, as long as that changes something.

        Args:
            but: Parameters that are left as they are.
        """
        seen = {self._now}
        for _ in range(MOST_ROUNDS):
            before = self._now
            for finding in self._serious(before):
                if finding.parameter not in but and self._apply(finding):
                    if self._now not in seen:
                        break
                    self._now = before
            else:
                return
            seen.add(self._now)

    def _apply(self, finding: Finding) -> bool:
        """Do what a finding asks for; return whether a value does it."""
        name, right = finding.parameter, finding.right
        if right is None or name not in DEFINITIONS or name in DECISIONS:
            return False
        if DEFINITIONS[name].kind is int and isinstance(right, float):
            right = int(right)
        names = filter(None, (name, finding.also))
        return self._set(_reason(finding), **dict.fromkeys(names, right))

    # ----------------------------------------------------------------------------------- velocity

    def _set_velocity(self, at_most: float) -> None:
        """Take the largest fast velocity that no check objects to."""
        velocity, now = self._fastest(at_most), self._now.homing_velocity_fast
        if velocity < now:
            worst = next(iter(self._objections(now, self._kinds(SLOWEST * now))), None)
            self._set(_reason(worst) if worst else FASTEST, **self._paces(velocity))
        elif velocity > now and any(one.motion.pace is Pace.FAST for one in self._searches):
            self._set(ROOM, **self._paces(velocity))

    def _fastest(self, at_most: float) -> float:
        """Return the largest fast velocity, up to a given one, that no check objects to."""
        low, high = SLOWEST * at_most, at_most
        always = self._kinds(low)
        if not self._objections(high, always):
            return high
        for _ in range(HALVINGS):
            middle = sqrt(low * high)
            low, high = (low, middle) if self._objections(middle, always) else (middle, high)
        return down(low)

    @property
    def _searches(self) -> list[Row]:
        rows = self._now.procedure.rows.values()
        return [row for row in rows if row.motion.kind is Kind.SEARCH]

    def _objections(
        self, velocity: float, always: Set[tuple[str, str]] = frozenset()
    ) -> list[Finding]:
        """Return what the checks have against a fast velocity, but for some kinds of findings."""
        found = self._serious(replace(self._now, **self._paces(velocity)))
        return [
            one
            for one in found
            if one.parameter not in FOLLOWS_VELOCITY and _kind(one) not in always
        ]

    def _kinds(self, velocity: float) -> Set[tuple[str, str]]:
        """Return the kinds of the findings against a fast velocity."""
        return {_kind(one) for one in self._objections(velocity)}

    def _paces(self, fast: float) -> dict[str, Any]:
        """Return the velocities that go with a fast velocity."""
        slow = self._now.homing_velocity_slow
        return {
            'homing_velocity_fast': fast,
            'homing_velocity_slow': slow if slow < fast else down(SLOWER * fast),
        }

    # ------------------------------------------------------------------------------------- bounds

    def _set_bound(self, name: str) -> None:
        """Give a bound that is not set the value that its check calls right."""
        now = self._now
        quicker = now.rehome and now.rehome_velocity > now.homing_velocity_fast
        if getattr(now, name) or (name == 'following_error' and quicker):
            return
        small: dict[str, Any] = {name: TOO_SMALL}
        asked = [
            one
            for one in self._serious(replace(now, **small))
            if one.parameter == name and isinstance(one.right, float)
        ]
        right = max((one.right for one in asked if isinstance(one.right, float)), default=0.0)
        if name == 'following_error':
            right = right and max(right, now.settling_tolerance)
        elif right >= now.search_distance:
            return
        if right:
            self._set(BOUNDS[name], **{name: right})


def _kind(finding: Finding) -> tuple[str, str]:
    return finding.check, finding.parameter


def _reason(finding: Finding) -> str:
    return f'{finding.what}; {finding.why}'
