# SPDX-License-Identifier: Apache-2.0
"""Reads a `$$` dump of grbl 1.1 or grblHAL.

grbl seeks the switch at the end of the axis, pulls off, locates it again slowly and pulls off once
more. Sources: grbl wiki, "Configuration"; grbl/limits.c; grblHAL wiki, "Additional settings".
"""

import re

from .converted import Axis, Converted, Row, Unconvertible

KIND = 'grbl $$ dump'

TABLE = (
    Row('$22', '', 'homing cycle; 0: the file is refused, for that controller does not home'),
    Row('$23', 'home_direction', 'bit of the axis set: Negative, else Positive'),
    Row('$24', 'homing_velocity_slow', 'mm/min'),
    Row('$25', 'homing_velocity_fast', "mm/min, at most the axis's max rate ($110 ...)"),
    Row(
        '$27',
        'homing_reverse_distance, home_shift_distance',
        'the pull-off, between the passes and at the end; here from where the switch falls',
    ),
    Row('$5', 'invert_..._ls_polarity', 'limit pins invert, of the limit switch that is homed on'),
    Row('$120, $121, ...', '..._acc, ..._dec, ls_dec', 'of every profile'),
    Row(
        '$130, $131, ...',
        'travel, home_position',
        'home reads -pull-off at a positive end, pull-off - travel at a negative one',
    ),
    Row('$43', 'repeat', 'grblHAL: home is the mean of the passes here, the last one there'),
    Row('$44 ... $47', 'home_sequence', "grblHAL's homing cycles; else z, then x and y (1.1)"),
    Row('$21', '', 'hard limits; while homing a limit of the other end acts by ls_type here'),
    Row('$26', '', 'a pause that lets the contacts settle; here switch_debounce filters them'),
    Row('$20', '', 'soft limits are not about homing'),
)

LETTERS = 'xyzabc'
_SETTING = re.compile(r'^[\s\'"]*\$(\d+)\s*=\s*([-+\d.]+)', re.MULTILINE)


def recognises(text: str) -> bool:
    """Tell whether a text is a dump of grbl."""
    return len(_SETTING.findall(text)) >= 3


def read(text: str, travel: float | None = None) -> Converted:
    """Read every axis that has a travel ($130 ...)."""
    values = {int(n): float(value) for n, value in _SETTING.findall(text)}
    if not int(values.get(22, 0)) & 1:
        raise Unconvertible('$22=0: the homing cycle is off in this controller')
    missing = [f'${n}' for n in (23, 24, 25, 27) if n not in values]
    if missing:
        raise Unconvertible(f'the dump has no {", ".join(missing)}')
    converted = Converted(KIND, [])
    for n, letter in enumerate(LETTERS):
        if values.get(130 + n, 0.0) > 0.0:
            converted.axes.append(_axis(n, letter, values))
        elif 100 + n in values and travel is not None:
            converted.axes.append(_axis(n, letter, {**values, 130 + n: 1e3 * travel}))
        elif 100 + n in values:
            refusal = f'no travel (${130 + n}); --travel gives one'
            converted.axes.append(Axis(letter, refusal=refusal))
    names = [axis.name for axis in converted.axes]
    cycles = [int(values[n]) for n in range(44, 48) if values.get(n)]
    if cycles:
        converted.sequence = [
            [name for name in names if mask >> LETTERS.index(name) & 1] for mask in cycles
        ]
        left = [name for name in names if not any(name in step for step in converted.sequence)]
        if left:
            converted.sequence.append(left)
    else:
        converted.sequence = [['z'], [name for name in names if name != 'z']]
        converted.remarks.append(
            'The order of grbl is compiled in; this is its default: z first, then the others.'
        )
    for n, name in ((20, 'soft limits'), (21, 'hard limits'), (26, 'homing debounce, ms')):
        if n in values:
            why = next(row.text for row in TABLE if row.source == f'${n}')
            converted.remarks.append(f'${n} = {values[n]:g} ({name}): no equal here; {why}.')
    converted.remarks.append(
        'grbl has one limit input for both ends of an axis. The limit switch of the end that '
        'homes is wired here; add the other one only if it is an input of its own.'
    )
    return converted


def _axis(n: int, letter: str, values: dict[int, float]) -> Axis:
    axis = Axis(letter)
    negative = bool(int(values[23]) >> n & 1)
    side = 'negative' if negative else 'positive'
    travel, pull_off = 1e-3 * values[130 + n], 1e-3 * values[27]
    rate = values.get(110 + n, values[25])
    fast = min(values[25], rate) / 60e3
    slow = min(values[24] / 60e3, fast)
    axis.set('home_type', 'LSLS', 'the limit switch, twice')
    axis.set('home_direction', side.capitalize(), f'$23 = {values[23]:g}, bit {n}')
    axis.set('travel', travel, f'${130 + n} = {values[130 + n]:g} mm')
    axis.set('homing_velocity_fast', fast, f'$25 = {values[25]:g}, ${110 + n} = {rate:g} mm/min')
    axis.set('homing_velocity_slow', slow, f'$24 = {values[24]:g} mm/min')
    acceleration = values.get(120 + n)
    axis.set_motion(
        acceleration and 1e-3 * acceleration,
        f'${120 + n} = {acceleration or 0:g} mm/s^2',
    )
    axis.set('homing_reverse_distance', pull_off, f'$27 = {values[27]:g} mm')
    axis.set('home_shift_distance', -pull_off, f'$27 = {values[27]:g} mm')
    axis.set(
        'home_position',
        pull_off - travel if negative else -pull_off,
        f'$27, ${130 + n}: grbl counts down from the positive end',
    )
    if values.get(43, 1.0) > 1.0:
        axis.set('repeat', int(values[43]), f'$43 = {values[43]:g}')
    axis.set('switches', [f'{side}_limit_switch'], '')
    if values.get(5):
        axis.set(f'invert_{side}_ls_polarity', True, f'$5 = {values[5]:g}')
    if values[25] > rate:
        axis.remarks.append(f'$25 is above the max rate of the axis: ${110 + n} holds.')
    if values[24] / 60e3 > fast:
        axis.remarks.append('$24 is above the seek rate: both velocities are that one here.')
    return axis
