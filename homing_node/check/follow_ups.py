# SPDX-License-Identifier: Apache-2.0
"""Leaves out the findings that only follow from another one."""

from collections.abc import Sequence

from .finding import Finding

#: Findings that say nothing while the limit switches are at the wrong ends.
OF_PLACES = frozenset(
    {
        'direction',
        'end-behind-limit',
        'end-unguarded',
        'flag-bounce',
        'flag-debounce',
        'flag-narrow',
        'hard-stop',
        'home-switch-place',
        'hs-reverse-bound',
        'coasting',
        'index-unreachable',
        'limit-beyond-stop',
        'limit-momentary',
        'limits-overlap',
        'ls-reverse-bound',
        'next-tier',
        'probe-unreachable',
        'reverse-into-limit',
        'search-bound',
        'shift-from-anywhere',
        'shift-into-limit',
        'shift-into-stop',
        'timeout',
    }
)
#: Findings that say nothing while an axis is so fast that no stop fits into its travel.
OF_SPEED = frozenset(
    {
        'accuracy',
        'end-following-error',
        'end-too-early',
        'flag-bounce',
        'flag-debounce',
        'flag-narrow',
        'following-error',
        'hard-stop',
        'jerk-decides',
        'limit-beyond-stop',
        'ls-reverse-bound',
        'next-tier',
        'open-loop',
        'reverse-into-limit',
        'run-up',
        'second-pass-fast',
        'shift-from-anywhere',
        'shift-into-limit',
        'shift-into-stop',
        'timeout',
        'wrong-direction',
    }
)
TOO_FAST = 'stop-longer-than-travel'
SWAPPED = 'limits-swapped'


def without_follow_ups(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings without those that follow from swapped limits or an absurd velocity.

    The finding about an absurd velocity names a velocity that satisfies all the others.
    """
    checks = {one.check for one in findings}
    dropped = (OF_PLACES if SWAPPED in checks else set()) | (
        OF_SPEED if TOO_FAST in checks else set()
    )
    kept = [one for one in findings if one.check not in dropped]
    return [_slowest(one, findings) if one.check == TOO_FAST else one for one in kept]


def _slowest(one: Finding, findings: Sequence[Finding]) -> Finding:
    """Return a finding about a velocity with the lowest velocity that any finding asks for."""
    asked = [
        each.right
        for each in findings
        if each.parameter == one.parameter and isinstance(each.right, float) and each.right > 0.0
    ]
    return one._replace(right=min(asked, default=None))
