# SPDX-License-Identifier: Apache-2.0
"""Sees to it that what a finding asks for can be written into the file as it stands."""

from collections.abc import Mapping
from dataclasses import replace

from ..parameters.axis import DEFINITIONS, AxisParameters
from .finding import Finding

#: What must follow a parameter where the file would else contradict itself.
FOLLOWS: Mapping[str, str] = {
    'homing_velocity_fast': 'homing_velocity_slow',
    'max_ls_reverse_distance': 'max_search_distance',
    'max_hs_on_at_start_reverse_distance': 'max_search_distance',
}


def applicable(finding: Finding, parameters: AxisParameters) -> Finding:
    """Return the finding, its remedy completed, or without one if no such file is valid."""
    name, right = finding.parameter, finding.right
    if right is None or name not in DEFINITIONS or DEFINITIONS[name].kind is tuple:
        return finding
    for names in [name], [name, FOLLOWS.get(name, name)]:
        if _valid(parameters, names, right):
            return finding._replace(also=''.join(names[1:]))
    return finding._replace(right=None)


def _valid(parameters: AxisParameters, names: list[str], right: object) -> bool:
    """Tell whether the parameters are no worse with a value."""
    try:
        values = {
            name: DEFINITIONS[name].convert(
                int(right) if DEFINITIONS[name].kind is int and isinstance(right, float) else right
            )
            for name in names
        }
    except ValueError:
        return False
    return set(replace(parameters, **values).cross_check()) <= set(parameters.cross_check())
