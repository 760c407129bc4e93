# SPDX-License-Identifier: Apache-2.0
"""How a home is applied by a service: the request with its values, and what must agree.

A request is YAML text. ``{name}`` stands for a value of the hand-over, ``{-name}`` for its
opposite, ``{name * 1e6}`` and ``{name / 2}`` for a scaled one: ``{data: {home_offset * 10000}}``.
"""

import re
from collections.abc import Mapping
from typing import Any

import yaml

from ..procedures.states import Apply, Restore
from .axis_fields import AxisFields
from .definition import suggestion

#: The values that a request may name; positions in m or rad.
VALUES: Mapping[str, str] = {
    'position': 'where the axis is now, homed',
    'home_offset': 'what the driver must take off its own coordinates; replaces what it takes off',
    'home_offset_change': 'the same, to be added to what the driver takes off now',
    'raw_position': 'where the axis is now, in the coordinates of the feedback',
    'home_position_raw': 'where the reference was found, in the coordinates of the feedback',
    'uncertainty': 'how far the home may be off',
    'axis': 'the name of the axis',
    'joint': 'the name of its joint',
}
TEXTS = ('axis', 'joint')

_NUMBER = r'[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?'
_PLACE = re.compile(
    r'\{\s*(?P<minus>-?)\s*(?P<name>[A-Za-z_]\w*)\s*(?:(?P<op>[*/])\s*(?P<factor>'
    + _NUMBER
    + r')\s*)?\}'
)
_TYPE = re.compile(r'[A-Za-z]\w*/srv/[A-Za-z]\w*')


def filled(request: str, values: Mapping[str, float | str]) -> Mapping[str, Any]:
    """Return the fields of a request with the values in their places.

    Args:
        request: The YAML text.
        values: A value for each name in `VALUES`.

    Raises:
        ValueError: The text names an unknown value, or is not a mapping in YAML.
    """

    def place(found: re.Match[str]) -> str:
        name = found['name']
        if name not in VALUES:
            raise ValueError(
                f'{{{name}}} is none of {", ".join(VALUES)}{suggestion(name, VALUES)}'
            )
        value = values[name]
        if isinstance(value, str):
            if found['minus'] or found['op']:
                raise ValueError(f'{{{name}}} is a text, it has no sign and no factor')
            return value
        if found['op']:
            factor = float(found['factor'])
            if not factor:
                raise ValueError(f'{found[0]}: the factor is 0')
            value = value * factor if found['op'] == '*' else value / factor
        return _as_yaml(-value if found['minus'] else value)

    try:
        read = yaml.safe_load(_PLACE.sub(place, request)) if request.strip() else {}
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f'not YAML: {str(error).splitlines()[0]}') from None
    if not isinstance(read, dict) or not all(isinstance(name, str) for name in read):
        raise ValueError(f'{read!r} is not a mapping of field names to values')
    return read


def _as_yaml(value: float) -> str:
    """Return a number that YAML reads back to the last bit: it wants a point before an e."""
    text = repr(value)
    mantissa, e, exponent = text.partition('e')
    return text if '.' in mantissa or not e else f'{mantissa}.0e{exponent}'


def contradictions(p: AxisFields) -> list[str]:
    """Return what does not agree in the parameters of the hand-over, a line each."""
    faults = []
    if p.travel_min > p.travel_max:
        faults.append(f'travel_min: {p.travel_min:g} m must be <= travel_max, {p.travel_max:g} m')
    if p.apply is not Apply.service:
        needless = ['apply_type', 'apply_request']
        needless += ['apply_service'] if p.apply is Apply.none else []
        faults += [
            f'{name}: {getattr(p, name)!r} has no effect with apply: {p.apply}'
            for name in needless
            if getattr(p, name)
        ]
        return faults
    kept = [f'rehome: {p.rehome}'] if p.rehome else []
    kept += [f'restore: {p.restore}'] if p.restore is not Restore.never else []
    faults += [
        f'{one} cannot be with apply: service, which changes the raw coordinates that are kept'
        for one in kept
    ]
    if not p.apply_service:
        faults.append('apply_service: required, but not set (apply is service)')
    if not p.apply_type:
        faults.append('apply_type: required, but not set (apply is service)')
    elif not _TYPE.fullmatch(p.apply_type):
        faults.append(
            f'apply_type: {p.apply_type!r} is not a type of a service, such as '
            'homing_interfaces/srv/SetPosition'
        )
    try:
        filled(p.apply_request, {name: 'x' if name in TEXTS else 1.0 for name in VALUES})
    except ValueError as error:
        faults.append(f'apply_request: {error}')
    return faults
