# SPDX-License-Identifier: Apache-2.0
"""What a gantry cannot have, and what must agree in its parameters (gantry.py)."""

from collections.abc import Mapping

from ..procedures.states import Apply, HomeType, Restore
from .axis_fields import AxisFields

_END = 'each side would push against its own end, and rack the gantry'
#: The home types that a gantry does not have, and why.
UNSUPPORTED: Mapping[HomeType, str] = {
    HomeType.CurrentPos: 'it finds nothing, so nothing says whether the gantry is square',
    HomeType.ZPulse: 'the first pulses of the sides from the start need not belong together',
    HomeType.MechanicalEndDetection: _END,
    HomeType.MechanicalEndDetectionHS: _END,
    HomeType.MechanicalEndDetectionLS: _END,
    HomeType.MechanicalEndDetectionReverseZPulse: _END,
}


def contradictions(p: AxisFields) -> list[str]:
    """Return what does not agree in the parameters of the leader of a gantry, a line each."""
    if not p.followers:
        return []
    faults = []
    if not p.max_skew:
        faults.append(
            f'max_skew: required with followers ({", ".join(p.followers)}): how far one side may '
            'get ahead of the other, m'
        )
    elif p.max_skew >= p.travel:
        faults.append(
            f'max_skew: {p.max_skew:g} m must be < travel, {p.travel:g} m: it is how far the '
            'bridge may rack'
        )
    elif p.square and p.square_tolerance >= p.max_skew:
        faults.append(
            f'square_tolerance: {p.square_tolerance:g} m must be < max_skew, {p.max_skew:g} m'
        )
    reason = UNSUPPORTED.get(p.home_type)
    if reason:
        faults.append(f'home_type: {p.home_type} cannot home a gantry: {reason}')
    if p.gantry_homing_use_slave_mechanical_end:
        faults.append(
            'gantry_homing_use_slave_mechanical_end: true is not there yet: a gantry homes on '
            'switches, Z-pulses or probes'
        )
    refused = {
        'open_loop_homing: true': p.open_loop_homing,
        f'wrap: {p.wrap:g} m': p.wrap,
        'rehome: true': p.rehome,
        f'restore: {p.restore}': p.restore is not Restore.never,
        f'apply: {p.apply}': p.apply is not Apply.none,
    }
    faults += [
        f'{text} cannot be with followers: a gantry does not have that yet'
        for text, is_set in refused.items()
        if is_set
    ]
    return faults
