# SPDX-License-Identifier: Apache-2.0
"""The file of one run: which topics it has, and what becomes of what the tap has noted."""

from array import array
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..parameters.axis import AxisParameters
from ..parameters.gantry import is_mirrored
from ..procedures.states import LATCHES, Input
from .cycles import Cycles
from .mcap_file import McapFile
from .tap import DriveTaken, Found, Reading, Taken
from .template import Template

JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
JOINT_STATE = 'sensor_msgs/msg/JointState'
BOOL, FLOAT64, STRING = 'std_msgs/msg/Bool', 'std_msgs/msg/Float64', 'std_msgs/msg/String'
AXIS_STATE = 'homing_interfaces/msg/AxisState'
SWITCH_EDGE = 'homing_interfaces/msg/SwitchEdge'

#: The names of the metadata: about the run, and how it ended.
ABOUT, OUTCOME = 'homing_node', 'outcome'
#: The numbers of a setpoint.
SETPOINT = 'position', 'velocity', 'acceleration'


def mirrored(leader: AxisParameters, followers: Mapping[str, AxisParameters]) -> dict[str, str]:
    """Return what the metadata tell of followers that count the other way round."""
    names = [name for name, one in followers.items() if is_mirrored(leader, one)]
    return {'mirrored': ' '.join(names)} if names else {}


class Messages(Protocol):
    """Makes the bytes of ROS messages.

    Attributes:
        level: A Bool.
        latched: A Float64.
    """

    level: Template
    latched: Template

    def text(self, kind: str) -> str:
        """Return the definition of a message type, in the format ros2msg."""

    def setpoint(self, joint: str) -> Template:
        """Return a JointTrajectory of one point."""

    def feedback(self, joint: str) -> Template:
        """Return a JointState of one position."""

    def edge(self, stamp: int, found: Found) -> bytes:
        """Return a SwitchEdge; the stamp in ns."""

    def string(self, text: str) -> bytes:
        """Return a String."""


class About(NamedTuple):
    """What a run is of.

    Attributes:
        node: The full name of the node.
        axis: The axis.
        joints: The joint of the axis, and then of each follower, by their full names.
        feedback: The full name of the topic `joint_states`.
        ahead: How long after its cycle the axis shall be at a setpoint, s.
        offset: How much stamps are ahead of the time of the core, ns.
        values: The version and the like, by name.
        parameters: The parameters of the axis, as a parameter file.
    """

    node: str
    axis: str
    joints: Mapping[str, str]
    feedback: str
    ahead: float
    offset: int
    values: Mapping[str, str]
    parameters: str


class RunFile:
    """The file of a run that is on."""

    def __init__(self, file: BinaryIO, about: About, begun: float, messages: Messages) -> None:
        """Begin the file.

        Args:
            file: Where it is written.
            about: What the run is of.
            begun: When it began, s of the core's time.
            messages: What makes the bytes of messages.

        Raises:
            OSError: It cannot be written.
        """
        self._file, self._about, self._messages = file, about, messages
        self._mcap = McapFile(file, f'homing_node {about.values.get("version", "")}'.strip())
        self._mcap.metadata(ABOUT, about.values)
        self._setpoint = {name: messages.setpoint(joint) for name, joint in about.joints.items()}
        self._feedback = {name: messages.feedback(joint) for name, joint in about.joints.items()}
        self._channels: dict[str, int] = {}
        self._private = f'{about.node}/{about.axis}'
        begin = int(self._stamps(begun))
        text = messages.string(about.parameters)
        self._mcap.add(self._channel(f'{self._private}/parameters', STRING), begin, begin, text)

    def write(self, taken: Taken) -> None:
        """Write what the tap has noted since the last time; it is in the file then.

        Raises:
            OSError: It cannot be written.
        """
        for drive in taken.drives:
            self._write_drive(drive, taken.cycles)
        for stamp, state in taken.states:
            channel = self._channel(f'{self._private}/state', AXIS_STATE)
            self._mcap.add(channel, stamp, stamp, state.serialized())
        self._mcap.flush()

    def finish(self, outcome: Mapping[str, str]) -> None:
        """Write how the run ended, and close the file.

        Raises:
            OSError: It cannot be written.
        """
        self._mcap.metadata(OUTCOME, outcome)
        self._mcap.finish()
        self._file.close()

    # ------------------------------------------------------------------------------------- inside

    def _stamps(self, times: Any) -> NDArray[np.int64]:
        """Return times of the core as stamps, ns."""
        return np.rint(np.asarray(times) * 1e9).astype(np.int64) + self._about.offset

    def _channel(self, topic: str, kind: str) -> int:
        if topic not in self._channels:
            self._channels[topic] = self._mcap.topic(topic, kind, self._messages.text(kind))
        return self._channels[topic]

    def _write_drive(self, drive: DriveTaken, cycles: Sequence[Cycles]) -> None:
        name = drive.name
        private = f'{self._about.node}/{name.replace(".", "/")}'
        for some in cycles:
            self._write_setpoints(name, some)
        if drive.feedback:
            self._write_feedback(name, drive.feedback, drive.sign)
        for source in dict.fromkeys(reading.source for reading in drive.readings):
            readings = [one for one in drive.readings if one.source is source]
            self._write_readings(private, source, readings)
        for one in drive.found:
            channel = self._channel(f'{private}/edges', SWITCH_EDGE)
            stamp = int(self._stamps(one.time))
            self._mcap.add(channel, stamp, stamp, self._messages.edge(stamp, one))

    def _write_setpoints(self, name: str, cycles: Cycles) -> None:
        times, numbers = cycles.of(name)
        if not len(times):
            return
        channel = self._channel(f'{self._about.node}/setpoints', JOINT_TRAJECTORY)
        stamps = self._stamps(times + self._about.ahead)
        columns = dict(zip(SETPOINT, numbers, strict=True))
        template = self._setpoint[name]
        self._mcap.add_block(channel, self._stamps(times), stamps, template, columns)

    def _write_feedback(self, name: str, packed: 'array[float]', sign: float) -> None:
        times, positions = np.frombuffer(packed).reshape(-1, 2).T
        stamps = self._stamps(times)
        channel = self._channel(self._about.feedback, JOINT_STATE)
        columns = {'position': positions * sign}
        self._mcap.add_block(channel, stamps, stamps, self._feedback[name], columns)

    def _write_readings(self, private: str, source: Input, readings: list[Reading]) -> None:
        stamps = self._stamps([one.now for one in readings])
        values = np.array([one.value for one in readings])
        latch = source in LATCHES
        template = self._messages.latched if latch else self._messages.level
        channel = self._channel(f'{private}/{source}', FLOAT64 if latch else BOOL)
        self._mcap.add_block(channel, stamps, stamps, template, {'data': values}, stamped=False)
