# SPDX-License-Identifier: Apache-2.0
"""Reads where things are on the sides of a gantry, and what joins them.

The axis itself is the leader's side. ``followers`` names the other sides; what is a follower's own
stands below ``<axis>.<follower>.``, and everything else is the leader's, at the place where it is
for the follower's encoder.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..parameters.definition import Definition, read, table
from .layout import LAYOUT, SWITCHES, AxisLayout, SwitchLayout, length, mirrored, shifted

FOLLOWER_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')

#: What only a gantry has, on each of its sides.
OF_SIDES = ('mass', 'delay')

#: The keys of a follower.
FOLLOWER: Mapping[str, Definition] = table(
    *(
        replace(definition, default=None) if definition.required else definition
        for name, definition in LAYOUT.items()
        if name not in ('followers', 'stays_off')
    ),
    Definition(
        'stiffness of the spring between it and the leader (0: nothing joins them)',
        float,
        'N/m',
        0.0,
        1e12,
        name='stiffness',
    ),
    length(
        'square_at',
        "its raw position minus the leader's where the gantry is square and the spring slack",
        0.0,
    ),
    Definition(
        'whether it counts the other way round than the leader',
        bool,
        name='mirrored',
        default=False,
    ),
)

Entries = Mapping[str, object]


def split(entries: Entries) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Separate the entries of an axis: its own, and those below each name with a dot."""
    own: dict[str, object] = {}
    blocks: dict[str, dict[str, object]] = {}
    for name, value in entries.items():
        block, dot, key = name.partition('.')
        if dot:
            blocks.setdefault(block, {})[key] = value
        else:
            own[name] = value
    return own, blocks


def gantry_faults(
    axis: str, own: Entries, names: Sequence[str], blocks: Mapping[str, Entries]
) -> list[str]:
    """Return what is wrong with an axis as a gantry, without the name of the axis."""
    faults = []
    for name in dict.fromkeys(names):
        if not FOLLOWER_NAME.fullmatch(name):
            faults.append(
                f'followers: {name!r} is not a name: a letter, then letters, digits and _'
            )
        elif name in FOLLOWER:
            faults.append(f'followers: {name!r} is a key of a layout')
    if len(set(names)) < len(names):
        faults.append(f'followers: a name stands twice in {", ".join(names)}')
    faults += [
        f'{block}: {block!r} is none of the followers of {axis}: add it to {axis}.followers, or '
        'delete its keys'
        for block in blocks
        if block not in names
    ]
    if not names:
        faults += [
            f'{name}: {own[name]!r} has no effect: {axis} has no followers'
            for name in OF_SIDES
            if name in own
        ]
    return faults


def follower_layout(leader: AxisLayout, entries: Entries) -> tuple[AxisLayout, list[str]]:
    """Return the layout of a follower, and the faults of its entries.

    Args:
        leader: The layout of the leader.
        entries: What is the follower's own; a switch that is None is not fitted there.
    """
    absent = [name for name in SWITCHES if name in entries and entries[name] is None]
    given = {name: value for name, value in entries.items() if value is not None}
    good, faults = read(given, FOLLOWER)
    own = {name: good[name] for name in given if name in good}
    same = shifted(leader._replace(followers={}), good.get('square_at', 0.0))
    if good.get('mirrored'):
        same = mirrored(same)
    stops = tuple(own.get('hard_stops', same.hard_stops))
    if stops[0] == stops[1]:
        faults.append(f'hard_stops: both are {stops[0]} m or rad, which leaves no travel')
    switches, found = _switches(own, same, absent)
    faults += found
    start = own.get('start', same.start)
    if not stops[0] <= start <= stops[1]:
        faults.append(
            f'start: {start} m or rad must be within hard_stops, [{stops[0]}, {stops[1]}]'
        )
    plain = {name: own[name] for name in AxisLayout._fields if name in own}
    of_follower = {name: good[name] for name in ('square_at', 'mirrored') if name in good}
    return same._replace(
        **plain | of_follower | {'hard_stops': stops, 'switches': switches}
    ), faults


def _switches(
    own: Mapping[str, Any], same: AxisLayout, absent: Sequence[str]
) -> tuple[dict[str, SwitchLayout], list[str]]:
    """Return the switches of a follower: its own, and those that it has as the leader."""
    faults = []
    switches = {}
    inverted = own.get('inverted')
    for name in SWITCHES:
        switch = None if name in absent else same.switches.get(name)
        if name in own:
            switch = (switch or SwitchLayout(*own[name]))._replace(
                on_from=own[name].low, on_to=own[name].high
            )
        if switch is None:
            if f'{name}_hysteresis' in own:
                faults.append(f'{name}_hysteresis: {name} is not given')
            if inverted and name in inverted:
                faults.append(f'inverted: {name} is not given')
            continue
        hysteresis = own.get(f'{name}_hysteresis', switch.hysteresis)
        off = switch.inverted if inverted is None else name in inverted
        switches[name] = switch._replace(hysteresis=hysteresis, inverted=off)
    return switches, faults
