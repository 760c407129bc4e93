# SPDX-License-Identifier: Apache-2.0
"""The node's subscriptions, polled by the cycle: messages and their stamps to the axes."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..core.position_array import OtherJoint
from ..core.stamps import REORDERED, Stamps, too_late
from ..parameters.definition import InvalidParameters
from ..parameters.wiring import Place, Wiring
from ..procedures.states import LATCHES, Error, FeedbackClock, Input
from . import messages
from .polling import Info, Take, taker, waiting
from .serialized import JointStateReader, PlainJointStateReader
from .timebase import TimeBase

#: In simulated time an edge is as old as its message's way, and the next cycle sees it: up to this
#: many periods lie between.
UNSTAMPED = 2.0
#: More lists of joints than publishers can have: the oldest one is forgotten.
MANY_LISTS = 100

#: Messages may come in another order than they were sent in, by up to this many.
REORDERED_MESSAGES = 10

#: Hears the last message of a publisher that latches it.
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: (message type, topic, QoS) -> a polled subscription; raises ValueError if there can be none.
Subscribe = Callable[[Any, str, Any], Any]


@dataclass(eq=False)
class WiredInput:
    """One wired input of an axis; ``heard``: its present publisher has sent a level."""

    source: Input
    topic: str
    stamps: Stamps
    subscription: Any
    heard: bool = False
    take: Take = field(init=False)

    def __post_init__(self) -> None:
        self.take = taker(self.subscription, serialized=True)

    @property
    def name(self) -> str:
        return f'{self.source} ({self.subscription.topic_name})'


class JointList:
    """The axes whose joints stand in one list of names, which one publisher sends.

    ``groups``: the axes with the same ``feedback_timeout`` and ``feedback_clock``, each with its
    place in the list; they judge a stamp alike. ``known``: the stamps that each axis last judged
    by. ``others``: joints that no axis homes, with their places. ``number``: that of the newest
    message; a new publisher counts from the beginning.
    """

    number = 0

    def __init__(
        self,
        places: Sequence[tuple[int, Axis]],
        known: dict[str, Stamps],
        others: Sequence[tuple[int, OtherJoint]] = (),
    ) -> None:
        self._places, self._known = places, known
        self.others = others
        self.groups: list[tuple[Stamps, list[tuple[int, Axis]]]] = []
        self.regroup()

    def regroup(self) -> None:
        """Follow changed parameters; what is known of the stamps stays."""
        groups: dict[tuple[float, str], tuple[Stamps, list[tuple[int, Axis]]]] = {}
        for place, axis in self._places:
            limit, clock = axis.parameters.feedback_timeout, axis.parameters.feedback_clock
            if (limit, clock) not in groups:
                stamps = copy(self._known.get(axis.name) or Stamps(limit, REORDERED))
                stamps.limit, stamps.clock = limit, clock
                groups[limit, clock] = stamps, []
            stamps, places = groups[limit, clock]
            places.append((place, axis))
            self._known[axis.name] = stamps
        self.groups = list(groups.values())


class Inputs:
    """All inputs of all axes.

    ``feedback_qos`` is the QoS of `joint_states`; ``destroy`` undoes ``subscribe``.
    ``late_cycle(late)`` returns the message of CycleLate if a cycle so late (s) ends a run, else
    ''. ``serialized``: read joint states from their bytes (serialized.py).

    Attributes:
        others: the joints that no axis homes and whose feedback is wanted, by name; set before the
            first poll.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        clock: TimeBase,
        subscribe: Subscribe,
        destroy: Callable[[Any], object],
        feedback_qos: Any,
        late_cycle: Callable[[float], str],
        serialized: bool = True,
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._subscribe, self._destroy = subscribe, destroy
        self._late_cycle = late_cycle
        self.others: Mapping[str, OtherJoint] = {}
        self._by_joint = {joint: axes[axis] for axis, joint in joints.items()}
        self._lists: dict[tuple[str, ...], JointList] = {}  # by the names of a message
        self._names: tuple[str, ...] = ()  # of the last message, and their list
        self._list = JointList([], {})
        self._feedback_stamps: dict[str, Stamps] = {}  # of each axis, as last judged
        self._reader = JointStateReader() if serialized else PlainJointStateReader()
        feedback = subscribe(JointState, 'joint_states', feedback_qos)
        self._feedback_topic = feedback.topic_name
        self._next_feedback = taker(feedback, True)
        # The latched subscription also receives what was published before the node started.
        self._emergency_stops = [
            taker(subscribe(Bool, '~/emergency_stop', qos), True) for qos in (10, LATCHED)
        ]
        self._wired: dict[str, list[WiredInput]] = {name: [] for name in axes}
        self._all: list[tuple[Take, Axis, WiredInput]] = []

    def wire(self, name: str, topics: Mapping[Input, str]) -> None:
        """Subscribe to the inputs that an axis's parameters name.

        An input whose topic has not changed keeps its subscription: no message of it is missed.

        Args:
            name: The axis.
            topics: The topics of its inputs; '' or no entry: the input's own topic.

        Raises:
            InvalidParameters: A topic cannot be subscribed to; nothing has changed then.
        """
        p = self._axes[name].parameters
        wanted = {source: topics.get(source) or f'~/{name}/{source}' for source in p.inputs}
        old = self._wired[name]
        wired = {one.source: one for one in old if wanted.get(one.source) == one.topic}
        faults = []
        for source, topic in wanted.items():
            if source in wired:
                continue
            try:
                wired[source] = self._connect(source, topic)
            except ValueError as error:
                faults.append(f'{name}.topics.{source}: {error}')
        self._wired[name] = old if faults else [wired[source] for source in wanted]
        for one in {*old, *wired.values()}.difference(self._wired[name]):
            self._destroy(one.subscription)
        if faults:
            raise InvalidParameters(faults)
        for one in self._wired[name]:
            one.stamps.limit = p.feedback_timeout
        for joints in self._lists.values():
            joints.regroup()
        self._all = [
            (one.take, self._axes[axis], one)
            for axis, inputs in self._wired.items()
            for one in inputs
        ]

    def _connect(self, source: Input, topic: str) -> WiredInput:
        kind = Float64 if source in LATCHES else Bool
        depth = 10 if source is Input.SERVO_ENABLED else 100
        return WiredInput(source, topic, Stamps(0.0), self._subscribe(kind, topic, depth))

    @property
    def wiring(self) -> Wiring:
        """Which signal each wired input reads, by the full names of the topics."""
        return Wiring(
            {
                Place(axis, one.source): one.subscription.topic_name
                for axis, inputs in self._wired.items()
                for one in inputs
            }
        )

    def poll(self) -> None:
        """Give the messages that have arrived to their axes, the feedback last."""
        self._clock.relate()
        for take, axis, one in self._all:
            taken = take()  # most are silent most of the time
            if taken is not None:
                self._take(axis, one, *taken)
                for data, info in waiting(take):
                    self._take(axis, one, data, info)
        for take in self._emergency_stops:
            for data, info in waiting(take):
                self._take_emergency_stop(data, info)
        for data, info in waiting(self._next_feedback):
            self._take_feedback(data, info)

    @property
    def feedback_topic(self) -> str:
        """The full name of the topic of the feedback."""
        return str(self._feedback_topic)

    def conflict(self, name: str, publishers_of: Callable[[str], list[str]]) -> Outcome | None:
        """Return which topic of an axis has two publishers, else None.

        ``publishers_of`` returns the names of the nodes that publish a topic.
        """
        axis = self._axes[name]
        conflict = axis.readings.conflict(axis.parameters.joint or name)
        if conflict is not None:
            nodes = ', '.join(publishers_of(self._feedback_topic))
            return Outcome(
                conflict.error,
                f'axis {name}: {conflict.seen} {self._feedback_topic} is published by {nodes}',
            )
        for one in self._wired[name]:
            publishers = one.subscription.get_publisher_count()
            if publishers > 1:
                topic = one.subscription.topic_name
                return Outcome(
                    Error.PublisherConflict,
                    f'axis {name}: {publishers} publishers on {topic}: '
                    f'{", ".join(publishers_of(topic))} (one that was killed stays listed for '
                    'about 20 s)',
                )
        return None

    def missing(self, name: str) -> list[Outcome]:
        """Return everything that is not there yet of an axis: publishers, levels, feedback."""
        unpublished, unheard = [], []
        for one in self._wired[name]:
            if one.subscription.get_publisher_count() == 0:
                unpublished.append(one.name)
            elif not one.heard and one.source not in LATCHES:
                unheard.append(one.name)
        found = []
        if unpublished:
            found.append(f'nobody publishes {", ".join(unpublished)}')
        if unheard:
            found.append(f'no message yet from {", ".join(unheard)}')
        missing = [Outcome(Error.SwitchUnknown, f'axis {name}: {text}') for text in found]
        if not self._axes[name].readings.known:
            joint = self._axes[name].parameters.joint or name
            text = f'axis {name}: no feedback yet for joint {joint!r}'
            missing.append(Outcome(Error.FeedbackStale, text))
        return missing

    def watch(self) -> None:
        """Note which inputs have lost their publisher: that ends a run of their axis."""
        for name, axis in self._axes.items():
            for one in self._wired[name]:
                if one.subscription.get_publisher_count() == 0:
                    one.heard = False  # a new publisher must send its level first
                    if axis.moving:
                        axis.stop(Error.SwitchStale, f'{one.name} lost its publisher')

    def _take(self, axis: Axis, one: WiredInput, data: bytes, info: Info) -> None:
        """Give a message of an input to the axis."""
        value = messages.data_of(data, one.subscription.msg_type)
        if value is None:
            return
        one.heard = True
        if one.source in LATCHES:
            axis.latch(one.source, value)
        elif one.source is Input.SERVO_ENABLED:
            axis.enable(bool(value))
        else:
            clock = self._clock
            clock.relate()
            arrival = stamp = clock.polled
            if not clock.simulated:
                arrival = min(arrival, clock.time_of(info['received_timestamp']))
                stamp = clock.time_of(info['source_timestamp'])
            found = one.stamps.believe(stamp, arrival)
            if found is not None:
                time, doubt = found
                if one.stamps.late:
                    self._stop(axis, Error.SwitchStale, too_late(one.name, one.stamps))
                if doubt:
                    axis.warn(f'{one.name}: {one.stamps.warning}')
                elif clock.simulated:
                    doubt = UNSTAMPED * axis.period
                axis.switch(one.source, time, bool(value), arrival, doubt)

    def _take_emergency_stop(self, data: bytes, _: Info) -> None:
        value = messages.data_of(data, Bool)
        for axis in self._axes.values():
            axis.set_emergency_stop(value is not False)  # what cannot be read is no all-clear

    def _take_feedback(self, data: bytes, info: Info) -> None:
        read = self._reader.read(data)
        if read is None:
            return
        sampled, names, positions = read
        clock = self._clock
        clock.relate()
        arrival = stamp = clock.polled
        sent: float | None = None  # without a header there is one time
        if not clock.simulated:
            arrival = min(arrival, clock.time_of(info['received_timestamp']))
            stamp = clock.time_of(info['source_timestamp'])
        if sampled:
            sent, stamp = stamp, clock.time_of(sampled)
        if names is not self._names:
            self._names, self._list = names, self._list_of(names)
        self._watch_publisher(self._list, info)
        known = len(positions)
        for place, joint in self._list.others:
            if place < known and isfinite(positions[place]):
                joint.feedback(positions[place], arrival)
        for stamps, places in self._list.groups:
            # Simulated time has one clock.
            found = stamps.believe(
                stamp, arrival, sent, FeedbackClock.stamp if clock.simulated else None
            )
            if found is None:
                continue
            time, doubt = found
            for place, axis in places:
                if stamps.late:
                    self._stop(axis, Error.FeedbackStale, too_late('joint_states', stamps))
                if place < known and isfinite(positions[place]):
                    axis.feedback(time, positions[place], arrival, doubt)
                    if doubt:
                        axis.warn(f'joint_states: {stamps.warning}')

    @staticmethod
    def _watch_publisher(joints: JointList, info: Info) -> None:
        """Notice that another publisher sends these joints: its messages count from 1 again."""
        number = info.get('publication_sequence_number', 0)
        if number + REORDERED_MESSAGES < joints.number:
            for _, places in joints.groups:
                for _, axis in places:
                    axis.feedback_source_changed()
        joints.number = number

    def _stop(self, axis: Axis, error: Error, text: str) -> None:
        """End a run for a message that was too late, or for the late cycle that made it late."""
        late_cycle = self._late_cycle(self._clock.elapsed)
        axis.stop(Error.CycleLate if late_cycle else error, late_cycle or text)

    def _list_of(self, names: tuple[str, ...]) -> JointList:
        """Return the list of joints with these names, which may be new."""
        if names in self._lists:
            return self._lists[names]
        if len(self._lists) >= MANY_LISTS:
            del self._lists[next(iter(self._lists))]
        joints = self._lists[names] = JointList(
            [
                (place, self._by_joint[name])
                for place, name in enumerate(names)
                if name in self._by_joint
            ],
            self._feedback_stamps,
            [
                (place, self.others[name])
                for place, name in enumerate(names)
                if name in self.others
            ],
        )
        return joints
