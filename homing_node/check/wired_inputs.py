# SPDX-License-Identifier: Apache-2.0
"""Checks which inputs are wired: unused ones, and ends without a limit switch."""

from collections.abc import Iterable, Iterator

from ..core.limits import Limit, limits_of
from ..procedures.motions import Way
from ..procedures.states import (
    LATCHES,
    LIMIT_PAIRS,
    LIMIT_SWITCHES,
    Input,
    LimitPair,
    LSType,
    Role,
)
from .axis_check import AxisCheck
from .finding import Finding, Severity


class WiredInputs(AxisCheck):
    """Inputs that do nothing, and limit switches that are missing."""

    def check(self, with_layout: bool = False) -> Iterator[Finding]:
        """Yield the findings; a layout, if there is one, judges the ends better."""
        yield from self.wiring()
        if not with_layout:
            yield from self.unplaced()

    def wiring(self) -> Iterator[Finding]:
        """Find inputs that are wired but not used, and actions without an input."""
        p = self.p
        used = set(p.procedure.inputs) | set(LIMIT_SWITCHES) | {Input.SERVO_ENABLED}
        for name in p.switches:
            if name not in used:
                why = (
                    'its latches are ignored'
                    if name in LATCHES
                    else 'yet no run starts before a message of it has come'
                )
                yield self.found(
                    Severity.info,
                    'wired-unused',
                    f'{name} is in switches, but {p.home_type} does not use it',
                    why,
                    'switches',
                    str(name),
                    f'without {name}',
                )
        for pair in (LimitPair.NEAR, LimitPair.EXTERNAL):
            for switch, ls_type in zip(LIMIT_PAIRS[pair], p.ls_types(pair), strict=True):
                if ls_type is LSType.none and switch in p.switches:
                    yield self.found(
                        Severity.warning,
                        'limit-disabled',
                        f'{switch} is in switches, but its LS Type is None',
                        'it is ignored',
                        f'{pair}_ls_type',
                        'None',
                        'Dec',
                    )
            if any(one is not LSType.none for one in p.ls_types(pair)) and not any(
                switch in p.switches for switch in LIMIT_PAIRS[pair]
            ):
                yield self.found(
                    Severity.warning,
                    'limit-not-wired',
                    f'{pair}_ls_type is {getattr(p, f"{pair}_ls_type")}, but neither of the '
                    f'{pair} limit switches is in switches',
                    'they cannot act',
                    'switches',
                    None,
                    f'with {" and ".join(LIMIT_PAIRS[pair])}',
                )

    def unplaced(self) -> Iterator[Finding]:
        """Find ends at which no limit switch acts; how bad that is only a layout tells."""
        limits = limits_of(self.p).values()
        for way in sorted({row.motion.way for _, row in self.searches}, reverse=True):
            here = [limit for limit in limits if limit.way is way]
            side = 'ahead' if way is Way.TOWARD else 'behind'
            if self.p.homes_on_mechanical_end and way is Way.TOWARD:
                yield from self._before_the_end(here)
                continue
            if not here:
                yield self.found(
                    Severity.info,
                    'end-unguarded',
                    f'no limit switch {side} is wired',
                    f'only {self.p.search_distance:g} m (max_search_distance) ends a search that '
                    'misses its switch',
                    'switches',
                    None,
                    f'with {self.p.limit_switch(LimitPair.HARDWARE, way)}',
                )
            elif not any(
                limit.action or limit.role in (Role.REVERSAL, Role.REFERENCE) for limit in here
            ):
                names = ', '.join(limit.input for limit in here)
                yield self.found(
                    Severity.warning,
                    'limit-without-action',
                    f'no limit switch {side} stops the axis ({names})',
                    'their LS Type is None, or this home type ignores them',
                    'ls_type',
                    'None',
                    'Dec',
                )

    def _before_the_end(self, ahead: Iterable[Limit]) -> Iterator[Finding]:
        for limit in ahead:
            if limit.role is Role.NORMAL and limit.action:
                yield self.found(
                    Severity.warning,
                    'end-behind-limit',
                    f'{limit.input} acts on the way to the mechanical end',
                    'if it is met before the end, every run ends with LSTriggered',
                    'mechanical_end_detection_ignore_ls',
                    'false',
                    True,
                )
