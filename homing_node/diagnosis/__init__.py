# SPDX-License-Identifier: Apache-2.0
"""Judges a running system: facts go in, findings come out, as `homing check` has them.

Pure. ``homing_node.ros.doctor`` collects the facts for `homing doctor`; the node collects those
about its controller in the background. doc/doctor.md explains each finding.
"""

from collections.abc import Iterator

from ..check.finding import Finding, Severity, worst_first
from .facts import Facts
from .feedback import judge_feedback
from .inputs import judge_inputs
from .listeners import judge_listeners

__all__ = ['diagnose']


def diagnose(facts: Facts) -> list[Finding]:
    """Return everything that is wrong, or worth knowing, about a running homing node."""
    return worst_first(
        [
            *judge_listeners(facts),
            *_sim_time(facts),
            *judge_feedback(facts),
            *judge_inputs(facts),
        ]
    )


def _sim_time(facts: Facts) -> Iterator[Finding]:
    for one in facts.controllers:
        other = (one.parameters or {}).get('use_sim_time')
        if isinstance(other, bool) and other is not facts.sim_time:
            yield Finding(
                Severity.error,
                '',
                'sim-time',
                f'use_sim_time is {str(facts.sim_time).lower()}, of {one.node} '
                f'{str(other).lower()}',
                'the stamps of the setpoints mean nothing to the controller',
                'use_sim_time',
                str(facts.sim_time).lower(),
                other,
            )
