# SPDX-License-Identifier: Apache-2.0
"""Reads layouts as they are parsed from YAML or from the parameters of `simulated_axes`."""

from collections.abc import Mapping

from ..parameters.definition import Interval, InvalidParameters, read, shown
from .gantry_layout import follower_layout, gantry_faults, split
from .layout import FURTHEST, LAYOUT, NOWHERE, SWITCHES, AxisLayout, SwitchLayout


def layouts_from(mapping: Mapping[str, object]) -> dict[str, AxisLayout]:
    """Read layouts, as parsed from YAML: axis name → key of `LAYOUT` → value.

    A key of a follower has its name before it: ``y2.stiffness``.

    Raises:
        InvalidParameters: Every fault, each begins with the axis and the key: ``x.lag: …``.
    """
    faults: list[str] = []
    layouts = {}
    for axis, entries in mapping.items():
        if isinstance(entries, Mapping):
            layout, found = _with_followers(axis, entries)
            layouts[axis] = layout
            faults += [f'{axis}.{fault}' for fault in found]
        else:
            faults.append(f'{axis}: {shown(entries)} is not a mapping of keys to values')
    if faults:
        raise InvalidParameters(faults)
    return layouts


def _with_followers(axis: str, entries: Mapping[str, object]) -> tuple[AxisLayout, list[str]]:
    """Return the layout of an axis with those of its followers, and the faults."""
    own, blocks = split(entries)
    layout, faults = _layout(own)
    listed = own.get('followers')
    names = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    faults += gantry_faults(axis, own, names, blocks)
    followers = {}
    for name in dict.fromkeys(names):
        follower, found = follower_layout(layout, blocks.get(name, {}))
        followers[f'{axis}.{name}'] = follower
        faults += [f'{name}.{fault}' for fault in found]
    return layout._replace(followers=followers), faults


def _layout(entries: Mapping[str, object]) -> tuple[AxisLayout, list[str]]:
    """Return the layout of one axis, and its faults."""
    good, faults = read(entries, LAYOUT)
    stops = good.get('hard_stops', Interval(-FURTHEST, FURTHEST))
    inverted = good.get('inverted', ())
    if stops.low == stops.high:
        faults.append(f'hard_stops: both are {stops.low} m or rad, which leaves no travel')
    switches = {}
    off = good.get('stays_off', ())
    for name in SWITCHES:
        if name not in entries:
            if f'{name}_hysteresis' in entries:
                faults.append(f'{name}_hysteresis: {name} is not given')
            if name in inverted and name not in off:
                faults.append(f'inverted: {name} is not given')
        elif good.get(name) is not None:
            low, high = good[name]
            hysteresis = good.get(f'{name}_hysteresis', 0.0)
            switches[name] = SwitchLayout(low, high, hysteresis, name in inverted)
            if name in off:
                faults.append(f'stays_off: where {name} is stands there, too')
    start = good.get('start', stops.low)
    if not stops.low <= start <= stops.high:
        faults.append(
            f'start: {start} m or rad must be within hard_stops, [{stops.low}, {stops.high}]'
        )
    plain = {key: good[key] for key in AxisLayout._fields if key in good}
    found = {
        'hard_stops': tuple(stops),
        'switches': switches,
        'stays_off': {name: NOWHERE._replace(inverted=name in inverted) for name in off},
    }
    return AxisLayout(**plain | found), faults
