# SPDX-License-Identifier: Apache-2.0
"""Reads LinuxCNC's ini: the homing keys of [JOINT_n], and of [AXIS_n] of old versions.

The signs of HOME_SEARCH_VEL and HOME_LATCH_VEL choose the sequence.
Source: LinuxCNC documentation, "Homing Configuration" and "INI Configuration".
"""

import re
from math import copysign, pi

from .converted import Axis, Converted, Row
from .sections import Sections, number, sections, shown

KIND = 'LinuxCNC ini'

TABLE = (
    Row('[TRAJ] LINEAR_UNITS, ANGULAR_UNITS', '', 'the units of all that follows; here m and rad'),
    Row(
        'HOME_SEARCH_VEL',
        'home_type, home_direction, homing_velocity_fast',
        'its sign is the direction; 0 (with HOME_LATCH_VEL 0): CurrentPos',
    ),
    Row(
        'HOME_LATCH_VEL',
        'home_type, homing_velocity_slow',
        'the same sign as HOME_SEARCH_VEL: HSHS, with HOME_USE_INDEX HSZPulse; the opposite sign: '
        'HSReverse, with HOME_USE_INDEX HSReverseZPulse',
    ),
    Row(
        'HOME_USE_INDEX',
        'home_type',
        'YES: the Z-pulse types; without HOME_SEARCH_VEL: ZPulse, in the direction of '
        'HOME_LATCH_VEL',
    ),
    Row('HOME_OFFSET, HOME', 'home_shift_distance', '(HOME - HOME_OFFSET), along the direction'),
    Row('HOME', 'home_position', 'what the axis reads after the final move'),
    Row('HOME_FINAL_VEL', 'home_shift_velocity', 'without it: as fast as the search'),
    Row('MIN_LIMIT, MAX_LIMIT', 'travel', 'their difference'),
    Row('MAX_ACCELERATION', '..._acc, ..._dec, ls_dec', 'of every profile'),
    Row('HOME_SEQUENCE', 'home_sequence', 'equal numbers home together; the sign is dropped'),
    Row('VOLATILE_HOME', 'clear_home_done_on_servo_off', ''),
    Row(
        'HOME_IGNORE_LIMITS',
        '',
        'limit switches are wired in HAL, which is not read; add those that there are to '
        '`switches`. A limit ahead then means the reversal',
    ),
    Row('HOME_IS_SHARED', '', 'an input of ours belongs to one axis'),
    Row('HOME_INDEX_NO_ENCODER_RESET', '', 'positions stay raw here; no encoder is ever reset'),
    Row('HOME_ABSOLUTE_ENCODER', '', 'an absolute encoder is not homed: the axis is refused'),
    Row('LOCKING_INDEXER', '', 'unlock it before the request'),
    Row('FERROR, MIN_FERROR', '', 'they hold for the servo thread; see following_error'),
)

#: Keys that become a remark, with the reason of the table.
NO_EQUAL = {name: row.text for row in TABLE if not row.ours for name in row.source.split(', ')}
READ = {name.strip() for row in TABLE if row.ours for name in row.source.split(',')} | {
    'TYPE',
    'MAX_VELOCITY',
}

METRES = {
    'mm': 1e-3, 'metric': 1e-3, 'inch': 0.0254, 'in': 0.0254, 'imperial': 0.0254,
    'cm': 1e-2, 'm': 1.0,
}  # fmt: skip
RADIANS = {'degree': pi / 180.0, 'deg': pi / 180.0, 'rad': 1.0, 'radian': 1.0, 'grad': pi / 200.0}

_JOINT = re.compile(r'(?:JOINT|AXIS)_(\d+)')


def recognises(text: str) -> bool:
    """Tell whether a text is an ini of LinuxCNC."""
    return re.search(r'^\s*\[(JOINT_\d+|AXIS_\d+|EMCMOT|EMC)\]', text, re.MULTILINE) is not None


def read(text: str, travel: float | None = None) -> Converted:
    """Read all joints; ``travel`` is for those without MIN_LIMIT and MAX_LIMIT."""
    found = sections(text)
    numbers = sorted({int(m[1]) for m in map(_JOINT.fullmatch, found) if m})
    names = _names(found, numbers)
    converted = Converted(KIND, [])
    steps: dict[int, list[str]] = {}
    for n in numbers:
        keys = {**found.get(f'AXIS_{n}', {}), **found.get(f'JOINT_{n}', {})}
        axis = _axis(names[n], keys, found.get('TRAJ', {}), travel)
        converted.axes.append(axis)
        sequence = number(keys, 'HOME_SEQUENCE')
        if sequence is None:
            axis.remarks.append('HOME_SEQUENCE is not set: LinuxCNC leaves it out of "home all"')
        steps.setdefault(99 if sequence is None else abs(int(sequence)), []).append(axis.name)
        if sequence is not None and sequence < 0:
            axis.remarks.append(
                f'HOME_SEQUENCE = {sequence:g}: LinuxCNC synchronises the final move of the '
                'joints of this number; here they home together, each on its own'
            )
    converted.sequence = [steps[key] for key in sorted(steps)]
    converted.remarks.append(
        'Not read: HAL, so polarity, debounce and which limit switches there are.'
    )
    return converted


def _names(found: Sections, numbers: list[int]) -> dict[int, str]:
    """Name each joint: by its letter where the kinematics tell it."""
    kins = found.get('KINS', {}).get('KINEMATICS', '')
    listed = re.search(r'coordinates\s*=\s*([A-Za-z ]+)', kins)
    letters = listed[1] if listed else found.get('TRAJ', {}).get('COORDINATES', '')
    ordered = [letter.lower() for letter in letters if letter.isalpha()]
    names: dict[int, str] = {}
    for n in numbers:
        letter = ordered[n] if n < len(ordered) else f'joint{n}'
        again = sum(name.rstrip('0123456789') == letter for name in names.values())
        names[n] = f'{letter}{again + 1}' if again else letter
    return names


def _axis(
    name: str, keys: dict[str, str], trajectory: dict[str, str], travel: float | None
) -> Axis:
    axis = Axis(name)
    angular = keys.get('TYPE', 'LINEAR').upper() == 'ANGULAR'
    unit, per_unit = _unit(trajectory, angular)
    if per_unit is None:
        axis.refusal = f'the unit {unit!r} is not known'
        return axis
    search = number(keys, 'HOME_SEARCH_VEL') or 0.0
    latch = number(keys, 'HOME_LATCH_VEL') or 0.0
    index = keys.get('HOME_USE_INDEX', 'NO').upper() in ('YES', 'TRUE', 'ON', '1')
    home_type = _home_type(axis, keys, search, latch, index)
    span = _travel(axis, keys, per_unit, travel)
    if axis.refusal or home_type is None or span is None:
        return axis
    sign = copysign(1.0, search or latch)
    axis.set('home_type', home_type, shown(keys, ['HOME_USE_INDEX']) or "the velocities' signs")
    if home_type != 'CurrentPos':
        side = 'Positive' if sign > 0.0 else 'Negative'
        axis.set('home_direction', side, "the velocities' signs")
    if angular:
        axis.set('unit', 'rad', shown(keys, ['TYPE']))
    axis.set('travel', *span)
    fast, slow = abs(search or latch), abs(latch or search)
    if home_type != 'CurrentPos':
        axis.set(
            'homing_velocity_fast',
            per_unit * max(fast, slow),
            shown(keys, ['HOME_SEARCH_VEL'] if search else ['HOME_LATCH_VEL']) + f' {unit}/s',
        )
        axis.set(
            'homing_velocity_slow', per_unit * slow, shown(keys, ['HOME_LATCH_VEL']) + f' {unit}/s'
        )
        if slow > fast:
            axis.remarks.append('HOME_LATCH_VEL is the faster one: both velocities are that here')
    else:
        sign = 1.0
    acceleration = number(keys, 'MAX_ACCELERATION')
    axis.set_motion(
        acceleration and per_unit * acceleration,
        shown(keys, ['MAX_ACCELERATION']) + f' {unit}/s^2',
    )
    _final_move(axis, keys, per_unit, unit, sign)
    wired = [] if home_type in ('CurrentPos', 'ZPulse') else ['home_switch']
    axis.set('switches', wired + (['z_pulse'] if index and home_type != 'CurrentPos' else []), '')
    if 'VOLATILE_HOME' in keys:
        volatile = keys['VOLATILE_HOME'] not in ('0', 'NO', 'FALSE')
        axis.set('clear_home_done_on_servo_off', volatile, shown(keys, ['VOLATILE_HOME']))
    _remark(axis, keys)
    return axis


def _unit(trajectory: dict[str, str], angular: bool) -> tuple[str, float | None]:
    if angular:
        unit = trajectory.get('ANGULAR_UNITS', 'degree').lower()
        return unit, RADIANS.get(unit)
    unit = trajectory.get('LINEAR_UNITS', 'mm').lower()
    return unit, METRES.get(unit)


def _home_type(
    axis: Axis, keys: dict[str, str], search: float, latch: float, index: bool
) -> str | None:
    """Return the home type that the velocities choose; refuse what LinuxCNC refuses."""
    if (number(keys, 'HOME_ABSOLUTE_ENCODER') or 0.0) != 0.0:
        axis.refusal = (
            f'{shown(keys, ["HOME_ABSOLUTE_ENCODER"])}: an absolute encoder is not homed'
        )
    elif not search and not latch:
        return 'CurrentPos'
    elif not search and index:
        return 'ZPulse'
    elif not search:
        axis.refusal = (
            f'{shown(keys, ["HOME_LATCH_VEL"])} without HOME_SEARCH_VEL and HOME_USE_INDEX: '
            'LinuxCNC refuses it too'
        )
    elif not latch:
        axis.refusal = (
            f'{shown(keys, ["HOME_SEARCH_VEL"])} without HOME_LATCH_VEL: LinuxCNC refuses it too'
        )
    elif (search > 0.0) == (latch > 0.0):
        return 'HSZPulse' if index else 'HSHS'
    else:
        return 'HSReverseZPulse' if index else 'HSReverse'
    return None


def _travel(
    axis: Axis, keys: dict[str, str], per_unit: float, given: float | None
) -> tuple[float, str] | None:
    low, high = number(keys, 'MIN_LIMIT'), number(keys, 'MAX_LIMIT')
    if low is not None and high is not None and high > low:
        return per_unit * (high - low), shown(keys, ['MIN_LIMIT', 'MAX_LIMIT'])
    if given is not None:
        return given, '--travel'
    if not axis.refusal:
        axis.refusal = (
            f'{shown(keys, ["MIN_LIMIT", "MAX_LIMIT"]) or "no MIN_LIMIT and MAX_LIMIT"}: '
            'no travel follows from it (--travel gives one)'
        )
    return None


def _final_move(axis: Axis, keys: dict[str, str], per_unit: float, unit: str, sign: float) -> None:
    home, offset = number(keys, 'HOME') or 0.0, number(keys, 'HOME_OFFSET') or 0.0
    origin = shown(keys, ['HOME', 'HOME_OFFSET'])
    axis.set('home_shift_distance', sign * per_unit * (home - offset), origin)
    axis.set('home_position', per_unit * home, shown(keys, ['HOME']))
    final = number(keys, 'HOME_FINAL_VEL')
    if final and final > 0.0:
        axis.set(
            'home_shift_velocity', per_unit * final, shown(keys, ['HOME_FINAL_VEL']) + f' {unit}/s'
        )
    elif home != offset:
        axis.remarks.append(
            'No HOME_FINAL_VEL: LinuxCNC moves at the rapid, the axis here as fast as it searches.'
        )


def _remark(axis: Axis, keys: dict[str, str]) -> None:
    """Remark every homing key that has no equal, and name the keys that are not about homing."""
    for key in keys:
        if key in NO_EQUAL:
            axis.remarks.append(f'{shown(keys, [key])}: no equal here; {NO_EQUAL[key]}.')
        elif key.startswith('HOME') and key not in READ:
            axis.remarks.append(f'{shown(keys, [key])}: not known, not converted.')
    others = [key for key in keys if key not in NO_EQUAL and key not in READ]
    others = [key for key in others if not key.startswith('HOME')]
    if others:
        axis.remarks.append(f'Not about homing: {", ".join(others)}.')
