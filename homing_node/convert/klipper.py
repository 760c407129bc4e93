# SPDX-License-Identifier: Apache-2.0
"""Reads Klipper's printer.cfg: the [stepper_...] sections of a cartesian machine.

Klipper moves to the endstop, retracts and moves to it again at the second speed; the position of
the second trigger is ``position_endstop``. Source: Klipper, "Configuration reference", [stepper];
klippy/stepper.py for the defaults.
"""

import re

from .converted import Axis, Converted, Row
from .sections import number, sections, shown

KIND = 'Klipper printer.cfg'

TABLE = (
    Row('homing_speed', 'homing_velocity_fast', 'mm/s, 5 without it'),
    Row('second_homing_speed', 'homing_velocity_slow', 'mm/s, half of homing_speed without it'),
    Row(
        'homing_retract_dist',
        'home_type, homing_reverse_distance',
        'mm, 5 without it: HSHS; 0: HS, one pass. Counted here from where the switch falls',
    ),
    Row(
        'homing_positive_dir',
        'home_direction',
        'without it: the end that position_endstop is nearer to',
    ),
    Row('position_endstop', 'home_position', 'what the axis reads at the trigger'),
    Row('position_min, position_max', 'travel', 'their difference'),
    Row('endstop_pin', 'invert_hs_polarity', '! inverts it; a pull-up (^, ~) is of no concern'),
    Row('[printer] max_accel, max_z_accel', '..._acc, ..._dec, ls_dec', 'of every profile'),
    Row('homing_retract_speed', '', 'the way back is as fast as the search'),
    Row(
        'endstop_pin: ...:virtual_endstop',
        '',
        'a driver that detects a stall is no switch here: the axis is refused '
        '(MechanicalEndDetection is the type that finds an end)',
    ),
    Row('endstop_pin: probe:z_virtual_endstop', '', 'a probe on the bed: the axis is refused'),
    Row('[printer] kinematics', '', 'of other than cartesian machines no axis is one joint'),
    Row('[safe_z_home], [homing_override]', '', 'what moves besides is the task of the caller'),
)

SEQUENCE = 'xyz'


def recognises(text: str) -> bool:
    """Tell whether a text is a configuration of Klipper."""
    return re.search(r'^\s*\[stepper_\w+\]', text, re.MULTILINE) is not None


def read(text: str, travel: float | None = None) -> Converted:
    """Read every stepper that has an endstop."""
    found = sections(text)
    printer = found.get('printer', {})
    converted = Converted(KIND, [])
    kinematics = printer.get('kinematics', 'cartesian')
    for name, keys in found.items():
        if not name.startswith('stepper_'):
            continue
        letter = name.removeprefix('stepper_')
        if 'endstop_pin' not in keys and letter[-1:].isdigit():
            converted.remarks.append(f'[{name}] moves with another stepper and has no endstop.')
        elif kinematics != 'cartesian' and letter != 'z':
            refusal = f'kinematics: {kinematics}: the axis is moved by several joints together'
            converted.axes.append(Axis(letter, refusal=refusal))
        else:
            converted.axes.append(_axis(letter, keys, printer, travel))
    names = [axis.name for axis in converted.axes]
    converted.sequence = [[name] for name in sorted(names, key=_turn)]
    for section in ('safe_z_home', 'homing_override'):
        if section in found:
            converted.remarks.append(f'[{section}]: no equal here; it is not homing.')
    others = [
        f'[{name}]' for name in found if name.split('_')[0] not in ('stepper', 'printer', 'safe')
    ]
    if others:
        converted.remarks.append(f'Not about homing: {", ".join(others)}.')
    return converted


def _turn(name: str) -> int:
    return SEQUENCE.find(name) if name in SEQUENCE else len(SEQUENCE)


def _axis(letter: str, keys: dict[str, str], printer: dict[str, str], given: float | None) -> Axis:
    axis = Axis(letter)
    pin, endstop = keys.get('endstop_pin', ''), number(keys, 'position_endstop')
    low, high = number(keys, 'position_min') or 0.0, number(keys, 'position_max')
    axis.refusal = _refusal(pin, endstop, high is not None or given is not None)
    if axis.refusal or endstop is None:
        return axis
    if high is not None:
        axis_travel, origin = 1e-3 * (high - low), f'{low:g} to {high:g} mm'
    else:
        axis_travel, origin, high = given or 0.0, '--travel', low + 1e3 * (given or 0.0)
    positive = _positive(keys, endstop, low, high)
    if positive is None:
        axis.refusal = f'{shown(keys, ["position_endstop"])} is at no end: set homing_positive_dir'
        return axis
    speed = number(keys, 'homing_speed') or 5.0
    second = number(keys, 'second_homing_speed') or 0.5 * speed
    retract = number(keys, 'homing_retract_dist')
    retract = 5.0 if retract is None else retract
    passes = 'HSHS' if retract else 'HS'
    axis.set('home_type', passes, shown(keys, ['homing_retract_dist']) or 'two passes')
    axis.set(
        'home_direction',
        'Positive' if positive else 'Negative',
        shown(keys, ['homing_positive_dir']) or shown(keys, ['position_endstop']),
    )
    axis.set('travel', axis_travel, origin)
    axis.set('homing_velocity_fast', 1e-3 * speed, f'homing_speed = {speed:g} mm/s')
    axis.set(
        'homing_velocity_slow',
        1e-3 * min(second, speed),
        f'second_homing_speed = {second:g} mm/s',
    )
    _accelerate(axis, letter, printer)
    if retract:
        axis.set(
            'homing_reverse_distance', 1e-3 * retract, f'homing_retract_dist = {retract:g} mm'
        )
    axis.set('home_position', 1e-3 * endstop, shown(keys, ['position_endstop']))
    axis.set('switches', ['home_switch'], f'endstop_pin = {pin}')
    if '!' in pin:
        axis.set('invert_hs_polarity', True, f'endstop_pin = {pin}')
    if 'homing_retract_speed' in keys:
        axis.remarks.append(
            f'{shown(keys, ["homing_retract_speed"])}: no equal here; the way back is as fast as '
            'the search.'
        )
    if second > speed:
        axis.remarks.append('second_homing_speed is the faster one: homing_speed is both here.')
    return axis


def _accelerate(axis: Axis, letter: str, printer: dict[str, str]) -> None:
    keys = ('max_z_accel', 'max_accel') if letter == 'z' else ('max_accel',)
    acceleration = number(printer, *keys)
    used = next((key for key in keys if number(printer, key) is not None), '')
    axis.set_motion(acceleration and 1e-3 * acceleration, shown(printer, [used]) + ' mm/s^2')


def _refusal(pin: str, endstop: float | None, has_travel: bool) -> str:
    if 'probe:' in pin:
        return f'endstop_pin = {pin}: a probe that touches the bed is no switch of this axis'
    if 'virtual_endstop' in pin:
        return (
            f'endstop_pin = {pin}: the driver detects a stall, there is no switch; '
            'MechanicalEndDetection is the type that finds an end'
        )
    if endstop is None:
        return 'no position_endstop'
    return '' if has_travel else 'no position_max (--travel gives a travel)'


def _positive(keys: dict[str, str], endstop: float, low: float, high: float) -> bool | None:
    """Return the direction as Klipper infers it: the endstop is within a quarter of an end."""
    if 'homing_positive_dir' in keys:
        return keys['homing_positive_dir'].lower() in ('true', 'yes', 'on', '1')
    quarter = (high - low) / 4.0
    if endstop <= low + quarter:
        return False
    return True if endstop >= high - quarter else None
