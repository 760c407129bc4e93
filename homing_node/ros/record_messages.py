# SPDX-License-Identifier: Apache-2.0
"""The bytes and the definitions of the messages in a record."""

import re
import struct
from functools import cache
from typing import Any

from homing_interfaces.msg import SwitchEdge
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ..recording.tap import Found
from ..recording.template import Template
from .message_types import message_class
from .messages import to_stamp

#: Numbers whose bytes stand nowhere else in a message, and where a stamp at its begin stands.
MARKS = 1.1e-300, 2.2e-300, 3.3e-300
STAMP = {'sec': ('<i4', 4), 'nanosec': ('<u4', 8)}
#: How the types of fields are written in a definition.
PLAIN = {'boolean': 'bool', 'octet': 'byte', 'float': 'float32', 'double': 'float64'}
SEQUENCE = re.compile(r'sequence<(?P<of>.+?)(, *(?P<bound>\d+))?>')
ARRAY = re.compile(r'(?P<of>.+)\[(?P<count>\d+)\]')
BOUNDED = re.compile(r'(?P<of>w?string)<(?P<bound>\d+)>')
RULE = '\n' + '=' * 80 + '\n'


class RecordMessages:
    """Makes the bytes of the messages of a record."""

    def __init__(self) -> None:
        self.level = Template(serialize_message(Bool()), {'data': ('u1', 4)})
        self.latched = _template(Float64(data=MARKS[0]), 'data')

    def text(self, kind: str) -> str:
        """Return the definition of a message type and of the types in it, as ros2msg."""
        return definition(kind)

    def setpoint(self, joint: str) -> Template:
        """Return a trajectory of one point of a joint."""
        position, velocity, acceleration = ([mark] for mark in MARKS)
        point = JointTrajectoryPoint(
            positions=position, velocities=velocity, accelerations=acceleration
        )
        message = JointTrajectory(joint_names=[joint], points=[point])
        return _template(message, 'position', 'velocity', 'acceleration')

    def feedback(self, joint: str) -> Template:
        """Return a joint state of one joint."""
        return _template(JointState(name=[joint], position=[MARKS[0]]), 'position')

    def edge(self, stamp: int, found: Found) -> bytes:
        """Return an edge as a run has found it; the stamp in ns."""
        message = SwitchEdge(
            stamp=to_stamp(stamp),
            input=str(found.source),
            level=bool(found.level),
            position=float(found.position),
            uncertainty=float(found.uncertainty),
            velocity=float(found.velocity),
        )
        return bytes(serialize_message(message))

    def string(self, text: str) -> bytes:
        """Return a text as a message."""
        return bytes(serialize_message(String(data=text)))

    def serialized(self, message: Any) -> bytes:
        """Return the bytes of a message."""
        return bytes(serialize_message(message))


def _template(message: Any, *names: str) -> Template:
    """Return a message whose marks are numbers with these names."""
    data = bytes(serialize_message(message))
    places = {
        name: ('<f8', data.index(struct.pack('<d', mark)))
        for name, mark in zip(names, MARKS, strict=False)
    }
    return Template(data, {**(STAMP if hasattr(message, 'header') else {}), **places})


@cache
def definition(kind: str) -> str:
    """Return the definition of a message type, and then of each type in it, as ros2msg.

    Raises:
        LookupError: A type is not installed.
    """
    texts: dict[str, str] = {}
    waiting = [kind.replace('/msg/', '/')]
    while waiting:
        one = waiting.pop(0)
        if one not in texts:
            texts[one], needed = _own_definition(one)
            waiting += needed
    first, *others = texts.items()
    return first[1] + ''.join(f'{RULE}MSG: {name}\n{text}' for name, text in others)


def _own_definition(kind: str) -> tuple[str, list[str]]:
    """Return the definition of a type alone, and the types that it needs."""
    lines, needed = [], []
    for name, written in message_class(kind).get_fields_and_field_types().items():
        text, of = _field_type(written)
        lines.append(f'{text} {name}\n')
        if '/' in of:
            needed.append(of)
    return ''.join(lines), needed


def _field_type(written: str) -> tuple[str, str]:
    """Return the type of a field as it stands in a definition, and the type of its elements."""
    if found := SEQUENCE.fullmatch(written):
        of, _ = _field_type(found['of'])
        bound = found['bound']
        return f'{of}[<={bound}]' if bound else f'{of}[]', of
    if found := ARRAY.fullmatch(written):
        of, _ = _field_type(found['of'])
        return f'{of}[{found["count"]}]', of
    if found := BOUNDED.fullmatch(written):
        return f'{found["of"]}<={found["bound"]}', found['of']
    return (PLAIN.get(written, written),) * 2
