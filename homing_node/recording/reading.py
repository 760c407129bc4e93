# SPDX-License-Identifier: Apache-2.0
"""Reads a run from an MCAP file: a record of the node, or a bag that has the node's topics.

A file that ends too early (the node was killed, the disk was full) is read up to there. No ROS is
needed. Times are those of the stamps, in s.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from ..core.outcome import MemberHome, Outcome
from ..course import Course, Happening, Sample
from ..procedures.states import LATCHES, Error, Input, State
from .run_file import (
    ABOUT,
    AXIS_STATE,
    BOOL,
    FLOAT64,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    STRING,
    SWITCH_EDGE,
)

KINDS = (AXIS_STATE, BOOL, FLOAT64, JOINT_STATE, JOINT_TRAJECTORY, STRING, SWITCH_EDGE)
NS = 1e-9
#: Setpoints of one cycle have times that differ by less, s.
SAME_CYCLE = 1e-6


class NoRun(ValueError):
    """A file that holds no run; the message says why."""


class Stamped(NamedTuple):
    """A message: when it was recorded and the time that it is of, s, and the message."""

    logged: float
    time: float
    message: Any


@dataclass
class Contents:
    """What a file holds.

    Attributes:
        topics: The messages by topic, in the order of the file.
        kinds: The type of each topic.
        metadata: The metadata by name.
        cut: Why the file ends too early, '' if it is whole.
    """

    topics: dict[str, list[Stamped]] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    cut: str = ''

    def of(self, kind: str) -> Iterator[tuple[str, list[Stamped]]]:
        """Yield the topics of a type, and their messages."""
        for topic, found in self.topics.items():
            if self.kinds[topic] == kind:
                yield topic, found


@dataclass
class RunRecord:
    """A run that was recorded.

    Attributes:
        axis: The axis.
        course: What it did.
        node: The full name of the node, '' if it is not known.
        parameters: The parameters of the axis, as a parameter file; '' if they are not known.
        unit: The unit of positions.
        title: What stands above the picture.
        cut: Why the record ends before the run, '' if it does not.
    """

    axis: str
    course: Course
    node: str = ''
    parameters: str = ''
    unit: str = 'm'
    title: str = ''
    cut: str = ''


def contents(path: Path) -> Contents:
    """Read a file as far as it goes.

    Raises:
        NoRun: It is no MCAP file.
        OSError: It cannot be read.
    """
    found = Contents()
    decoders = DecoderFactory()
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    with path.open('rb') as file:
        limit = max(1, path.stat().st_size)
        reader = StreamReader(file, validate_crcs=True, record_size_limit=limit)
        try:
            for record in reader.records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Metadata):
                    found.metadata[record.name] = record.metadata
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    schema = schemas.get(channel.schema_id)
                    if schema is not None and schema.name in KINDS:
                        decode = decoders.decoder_for(channel.message_encoding, schema)
                        if decode is not None:
                            found.kinds[channel.topic] = schema.name
                            found.topics.setdefault(channel.topic, []).append(
                                Stamped(
                                    record.log_time * NS,
                                    record.publish_time * NS,
                                    decode(record.data),
                                )
                            )
        except Exception as error:  # the library raises what its parts raise
            if not schemas:
                text = str(error) if isinstance(error, McapError) else 'it ends too early'
                text = text or 'it is empty'
                raise NoRun(f'{path}: no MCAP file with ROS 2 messages: {text}') from None
            found.cut = 'the file ends too early'
    return found


def read(path: Path, axis: str = '') -> RunRecord:
    """Read the last run of an axis in a file.

    Args:
        path: The file.
        axis: The axis; '' where there is one alone, or one alone has a run.

    Raises:
        NoRun: There is no run of such an axis in it.
        OSError: It cannot be read.
    """
    found = contents(path)
    try:
        return _run_of(found, path, axis)
    except AttributeError as error:  # a damaged definition has other fields
        raise NoRun(f'{path}: a definition of a message in it is damaged: {error}') from None


def _run_of(found: Contents, path: Path, axis: str) -> RunRecord:
    """Return the last run of an axis; see `read`."""
    states = _states_by_axis(found)
    if not states:
        raise NoRun(f'{path}: no state of an axis in it: no topic of type {AXIS_STATE}')
    if axis and axis not in states:
        raise NoRun(f'{path}: no axis {axis!r} in it, only {", ".join(states)}')
    ran = [name for name, told in states.items() if _last_run(told)[0]]
    axis = axis or (ran[0] if len(ran) == 1 else '')
    if not axis and len(states) > 1:
        raise NoRun(f'{path}: it has the axes {", ".join(states)}; say which with --axis')
    axis = axis or next(iter(states))
    about = found.metadata.get(f'{ABOUT}/{axis}') or found.metadata.get(ABOUT, {})
    node = next(
        topic.removesuffix(f'/{axis}/state')
        for topic, messages in found.of(AXIS_STATE)
        if any(one.message.axis == axis for one in messages)
    )
    course = _course(found, node, axis, about.get('joint', ''), states[axis])
    for name in about.get('mirrored', '').split():
        if name in course.followers:
            course.followers[name].mirrored = True
    ended = course.outcome is not None
    begun = datetime.fromtimestamp(states[axis][0].logged, timezone.utc)
    title = f'{axis}: {about.get("home_type", "")} recorded {begun:%Y-%m-%d %H:%M:%S} UTC'
    return RunRecord(
        axis,
        course,
        node,
        _parameters(found, axis),
        about.get('unit', 'm'),
        ' '.join(title.split()),
        '' if ended else found.cut or 'the record ends before the run',
    )


# ------------------------------------------------------------------------------- what is in a file


def _states_by_axis(found: Contents) -> dict[str, list[Stamped]]:
    states: dict[str, list[Stamped]] = {}
    for _, messages in found.of(AXIS_STATE):
        for one in messages:
            states.setdefault(one.message.axis, []).append(one)
    return states


def _parameters(found: Contents, axis: str) -> str:
    for topic, messages in found.of(STRING):
        if topic.endswith(f'/{axis}/parameters'):
            return str(messages[-1].message.data)
    return ''


def _course(found: Contents, node: str, axis: str, joint: str, states: list[Stamped]) -> Course:
    """Return the last run of an axis, with those of its followers."""
    run, after = _last_run(states)
    span = run[0].logged if run else 0.0, after.logged if after else np.inf
    course = _course_of(found, node, axis, joint or _joint(found, axis), states, span)
    course.outcome = None if after is None else _outcome(after.message)
    for member in states[-1].message.members[1:]:
        name = f'{axis}.{member.name}'
        other = _course_of(found, node, name, member.joint, states, span)
        other.samples = _at_times_of(course.samples, other.samples)
        course.followers[name] = other
    return course


def _course_of(
    found: Contents,
    node: str,
    name: str,
    joint: str,
    states: list[Stamped],
    span: tuple[float, float],
) -> Course:
    """Return what a drive has done from one time to another; ``name``: its full name."""
    feedback = _feedback(found, joint, f'{node}/joint_states')
    inverted = _inverted(found, name)
    samples = list(_samples(found, joint, feedback, states, *span))
    happenings = [
        one
        for one in _happenings(found, name, feedback, inverted)
        if span[0] <= one.time <= span[1]
    ]
    return Course(samples, happenings, inverted=inverted)


def _at_times_of(leader: Sequence[Sample], own: Sequence[Sample]) -> list[Sample]:
    """Return a sample of a follower for each of the leader's: the one of the same cycle."""
    by_time = {round(one.time / SAME_CYCLE): one for one in own}
    nothing = Sample(np.nan, '', np.nan, np.nan, np.nan, np.nan)
    return [
        by_time.get(round(one.time / SAME_CYCLE), nothing)._replace(time=one.time, state=one.state)
        for one in leader
    ]


def _last_run(states: Sequence[Stamped]) -> tuple[list[Stamped], Stamped | None]:
    """Return the states of the last run, and the state after it."""
    stretches = [
        (idle, list(stretch))
        for idle, stretch in groupby(states, lambda one: one.message.state == State.Idle)
    ]
    for number in range(len(stretches) - 1, -1, -1):
        idle, run = stretches[number]
        if not idle:
            after = stretches[number + 1][1][0] if number + 1 < len(stretches) else None
            return run, after
    return [], states[-1]


def _joint(found: Contents, axis: str) -> str:
    """Return the joint of an axis whose parameters are not in the file."""
    joints = {
        name for _, some in found.of(JOINT_STATE) for one in some for name in one.message.name
    }
    return axis if axis in joints or len(joints) != 1 else joints.pop()


class Places(NamedTuple):
    """The feedback of an axis: times, s, and raw positions."""

    times: Any
    positions: Any

    def at(self, time: float) -> float:
        """Return the position at a time; NaN where nothing is known."""
        return float(np.interp(time, self.times, self.positions)) if len(self.times) else np.nan


def _feedback(found: Contents, joint: str, homed: str) -> Places:
    """Return the raw positions of a joint; of several topics the one that has most of them.

    ``homed`` is the topic that has homed coordinates.
    """
    best: list[tuple[float, float]] = []
    for topic, messages in found.of(JOINT_STATE):
        if topic == homed:
            continue
        series = []
        for one in messages:
            names = list(one.message.name)
            if joint in names and names.index(joint) < len(one.message.position):
                stamp = one.message.header.stamp
                time = stamp.sec + stamp.nanosec * NS or one.time
                series.append((time, float(one.message.position[names.index(joint)])))
        best = max(best, series, key=len)
    ordered = sorted(best)
    return Places([time for time, _ in ordered], [place for _, place in ordered])


def _samples(
    found: Contents,
    joint: str,
    feedback: Places,
    states: Sequence[Stamped],
    begin: float,
    end: float,
) -> Iterator[Sample]:
    """Yield the setpoints of a run, with the state and the feedback at their times."""
    logged = [one.logged for one in states]
    for _, messages in found.of(JOINT_TRAJECTORY):
        for one in messages:
            names = list(one.message.joint_names)
            if joint not in names or not one.message.points or not begin <= one.logged <= end:
                continue
            point, place = one.message.points[0], names.index(joint)
            stamp, ahead = one.message.header.stamp, point.time_from_start
            time = stamp.sec + stamp.nanosec * NS or one.time
            time += ahead.sec + ahead.nanosec * NS
            state = states[max(0, bisect_right(logged, one.logged) - 1)].message.state
            yield Sample(
                time,
                str(state),
                float(point.positions[place]),
                float(point.velocities[place]) if len(point.velocities) > place else np.nan,
                float(point.accelerations[place]) if len(point.accelerations) > place else np.nan,
                feedback.at(time),
            )


def _inverted(found: Contents, name: str) -> frozenset[str]:
    """Return the switches of a drive whose level on the wire differs from the state."""
    axis, _, follower = name.partition('.')
    wire = {
        topic.rpartition('/')[2]: messages[0].message.data
        for topic, messages in found.of(BOOL)
        if topic.rpartition('/')[0].endswith(_path(name))
    }
    of_side = f'{follower}.' if follower else ''
    for _, states in found.of(AXIS_STATE):
        for one in states:
            if one.message.axis == axis:
                levels = dict(zip(one.message.inputs, one.message.levels, strict=False))
                return frozenset(
                    source
                    for source, level in wire.items()
                    if levels.get(f'{of_side}{source}') == int(not level)
                )
    return frozenset()


def _path(name: str) -> str:
    """Return the part of the topics of an axis, or of a follower by its full name."""
    return f'/{name.replace(".", "/")}'


def _happenings(
    found: Contents, drive: str, feedback: Places, inverted: frozenset[str]
) -> Iterator[Happening]:
    """Yield the edges as the run has found them, else the changes of the inputs."""
    located: set[str] = set()
    for topic, messages in found.of(SWITCH_EDGE):
        if topic.endswith(f'{_path(drive)}/edges'):
            for one in messages:
                edge = one.message
                located.add(edge.input)
                level = edge.level != (edge.input in inverted)
                yield Happening(one.time, edge.input, level, edge.position)
    inputs = {str(one) for one in Input}
    for kind in (BOOL, FLOAT64):
        for topic, messages in found.of(kind):
            name = topic.rpartition('/')[2]
            if name not in inputs - located or not topic.endswith(f'{_path(drive)}/{name}'):
                continue
            latch = Input(name) in LATCHES
            before = None if latch else messages[0].message.data
            for one in messages:
                value = one.message.data
                if latch:
                    yield Happening(one.time, name, float(value), float(value))
                elif value != before:
                    before = value
                    yield Happening(one.time, name, bool(value), feedback.at(one.time))


def _outcome(state: Any) -> Outcome:
    try:
        error = Error(state.error)
    except ValueError:  # of a newer version
        error = Error.InternalError
    return Outcome(
        error,
        state.message,
        home_position_raw=state.home_position_raw,
        home_offset=state.home_offset,
        uncertainty=state.uncertainty,
        members=tuple(
            MemberHome(**{name: getattr(one, name) for name in MemberHome._fields})
            for one in state.members
        ),
    )
