# SPDX-License-Identifier: Apache-2.0
"""Reads ros2_canopen's bus.yml: the homing objects that it writes to CiA 402 drives.

Sources: ros2_canopen, "Configuration" (bus.yml, Cia402Driver); CiA 402-2, homing mode.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import yaml

from ..procedures import cia402
from ..procedures.states import Input
from ..procedures.tables import PROCEDURES
from .converted import Axis, Converted, Row, Unconvertible

KIND = 'ros2_canopen bus.yml'

TABLE = (
    Row('0x6098', 'home_type, home_direction', 'the number itself; doc/cia402.md'),
    Row('0x6099:1', 'homing_velocity_fast', 'device units, times scale_vel_from_dev'),
    Row('0x6099:2', 'homing_velocity_slow', 'device units, times scale_vel_from_dev'),
    Row('0x609A', '..._acc, ..._dec, ls_dec', 'device units, times scale_vel_from_dev'),
    Row(
        '0x607C',
        'home_position',
        'device units, times scale_pos_from_dev; what the axis reads at home. '
        'Some drives take its negative: try it',
    ),
    Row('0x607D:1, 0x607D:2', 'travel', 'the difference of the software limits'),
    Row('scale_pos_from_dev, scale_vel_from_dev', '', 'the units; 0.001 without them'),
    Row('0x60FD', '', 'the inputs: publish them as topics (bit 0, 1, 2: limits -, +, home)'),
    Row('homing_timeout_seconds', 'timeout', ''),
)

#: The objects that are read.
READ = {(0x6098, 0), (0x6099, 1), (0x6099, 2), (0x609A, 0), (0x607C, 0), (0x607D, 1), (0x607D, 2)}
NOT_DRIVES = {'options', 'master', 'defaults', 'nodes'}
DEFAULT_SCALE = 1e-3


def recognises(text: str) -> bool:
    """Tell whether a text is a bus configuration."""
    try:
        return any(True for _ in _drives(_mapping(text)))
    except (yaml.YAMLError, ValueError, RecursionError):  # the last: nested too deeply
        return False


def read(text: str, travel: float | None = None) -> Converted:
    """Read every drive."""
    converted = Converted(KIND, [])
    for name, drive in _drives(_mapping(text)):
        converted.axes.append(_axis(name, drive, travel))
    converted.sequence = [[axis.name] for axis in converted.axes]
    converted.remarks.append(
        'The drive homed itself; now the node homes the joint. Set 0x6098 to 0, or do not call '
        'init, else it homes twice.'
    )
    return converted


def _mapping(text: str) -> Mapping[str, Any]:
    found = yaml.safe_load(text)
    if not isinstance(found, dict):
        raise Unconvertible('it holds no names')
    return found


def _drives(bus: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each drive with the defaults below it."""
    defaults = bus.get('defaults') or {}
    listed = {**bus, **(bus.get('nodes') or {})}
    for name, own in listed.items():
        if name in NOT_DRIVES or not isinstance(own, dict) or 'node_id' not in own:
            continue
        merged = {**defaults, **own, 'sdo': [*_sdo(defaults), *_sdo(own)]}
        if '402' in str(merged.get('driver', '')) or '402' in str(merged.get('package', '')):
            yield str(name), merged


def _sdo(drive: Mapping[str, Any]) -> list[Any]:
    return [entry for entry in drive.get('sdo') or [] if isinstance(entry, dict)]


def _axis(name: str, drive: Mapping[str, Any], given: float | None) -> Axis:
    axis = Axis(''.join(c if c.isalnum() else '_' for c in name))
    objects = {
        (int(e.get('index', 0)), int(e.get('sub_index', 0))): float(e.get('value', 0))
        for e in drive['sdo']
    }
    number = int(objects.get((0x6098, 0), 0))
    try:
        method = cia402.method(number) if number else None
    except ValueError as error:
        axis.refusal = f'0x6098: {error}'
        return axis
    if method is None:
        axis.refusal = (
            '0x6098 is 0: the drive does not home'
            if (0x6098, 0) in objects
            else '0x6098 is not set: the method is stored in the drive'
        )
        return axis
    position = float(drive.get('scale_pos_from_dev', DEFAULT_SCALE))
    velocity = float(drive.get('scale_vel_from_dev', DEFAULT_SCALE))
    axis.set('home_type', number, f'0x6098; {method.home_type}')
    low, high = objects.get((0x607D, 1)), objects.get((0x607D, 2))
    if low is not None and high is not None and high > low:
        axis.set('travel', position * (high - low), f'0x607D = {low:g} to {high:g}')
    elif given is not None:
        axis.set('travel', given, '--travel')
    else:
        axis.refusal = 'no travel (0x607D:1 and 0x607D:2); --travel gives one'
        return axis
    fast, slow = objects.get((0x6099, 1)), objects.get((0x6099, 2))
    if fast:
        axis.set('homing_velocity_fast', velocity * fast, f'0x6099:1 = {fast:g}')
    if slow:
        slowest = min(slow, fast or slow)
        axis.set('homing_velocity_slow', velocity * slowest, f'0x6099:2 = {slow:g}')
    acceleration = objects.get((0x609A, 0))
    axis.set_motion(acceleration and velocity * acceleration, f'0x609A = {acceleration or 0:g}')
    if offset := objects.get((0x607C, 0)):
        axis.set('home_position', position * offset, f'0x607C = {offset:g}')
    if 'homing_timeout_seconds' in drive:
        axis.set('timeout', float(drive['homing_timeout_seconds']), 'homing_timeout_seconds')
    axis.set('switches', _inputs(method), 'what the method needs, and the limit switches')
    others = sorted({index for index, sub in objects if (index, sub) not in READ})
    if others:
        axis.remarks.append('Not about homing: ' + ', '.join(f'0x{n:04X}' for n in others) + '.')
    axis.remarks += [f'Differs from the standard: {one}.' for one in method.differences]
    if not fast or not slow:
        axis.remarks.append('0x6099 is not set for both speeds: the defaults of ours hold.')
    return axis


def _inputs(method: cia402.Method) -> list[str]:
    """Return the inputs that a method needs, and the limit switches of a drive."""
    if method.direction is None:
        return []
    needed = [str(name) for name in sorted(PROCEDURES[method.home_type].inputs)]
    limits = [str(Input.POSITIVE_LIMIT_SWITCH), str(Input.NEGATIVE_LIMIT_SWITCH)]
    return [*needed, *limits]
