# SPDX-License-Identifier: Apache-2.0
"""The node's subscriptions, polled by the cycle: messages and their stamps to the axes."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..core.stamps import REORDERED, Stamps, too_late
from ..parameters.definition import InvalidParameters
from ..procedures.states import LATCHES, Error, Input
from . import convert
from .arrivals import Arrivals
from .serialized import JointStateReader
from .timebase import TimeBase

#: In simulated time an edge is as old as its way took, and it is seen at the next cycle: this many
#: periods may lie between.
UNSTAMPED = 2.0
#: More lists of joints than publishers can have: the oldest one is forgotten.
MANY_FEEDS = 100

Info = Mapping[str, int]  # what the middleware tells of a message
#: (message type, topic, QoS) -> a polled subscription; raises ValueError where there can be none.
Subscribe = Callable[[Any, str, Any], Any]
Take = Callable[[], tuple[bytes, Info] | None]  # the next message that has arrived, serialized


@dataclass(eq=False)
class Wire:
    """One wired input of an axis; ``heard``: its present publisher has told a level."""

    source: Input
    topic: str
    inverted: bool
    stamps: Stamps
    subscription: Any
    heard: bool = False
    take: Take = field(init=False)

    def __post_init__(self) -> None:
        self.take = _taker(self.subscription)

    @property
    def name(self) -> str:
        return f'{self.source} ({self.subscription.topic_name})'


class Feed:
    """The axes whose joints stand in one list, as one publisher tells them.

    ``groups``: the axes with the same ``feedback_timeout`` and their places in the list; what they
    believe of a stamp is the same. ``known``: what each axis last believed by.
    """

    def __init__(self, places: Sequence[tuple[int, Axis]], known: dict[str, Stamps]) -> None:
        self._places, self._known = places, known
        self.groups: list[tuple[Stamps, list[tuple[int, Axis]]]] = []
        self.regroup()

    def regroup(self) -> None:
        """Follow changed parameters; what is known of the stamps stays."""
        groups: dict[float, tuple[Stamps, list[tuple[int, Axis]]]] = {}
        for place, axis in self._places:
            limit = axis.parameters.feedback_timeout
            if limit not in groups:
                stamps = copy(self._known.get(axis.name) or Stamps(limit, REORDERED))
                stamps.limit = limit
                groups[limit] = stamps, []
            stamps, places = groups[limit]
            places.append((place, axis))
            self._known[axis.name] = stamps
        self.groups = list(groups.values())


class Inputs:
    """All inputs of all axes.

    ``feedback_qos`` is the QoS of `joint_states`; ``destroy`` undoes ``subscribe``; ``arrivals``
    tells of messages of wired inputs; ``hold_up`` tells of a cycle that is so late that the run
    ends for it, and returns '' for any other.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        clock: TimeBase,
        subscribe: Subscribe,
        destroy: Callable[[Any], object],
        feedback_qos: Any,
        arrivals: Arrivals,
        hold_up: Callable[[float], str],
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._subscribe, self._destroy = subscribe, destroy
        self._arrivals = arrivals
        self._hold_up = hold_up
        self._by_joint = {joint: axes[axis] for axis, joint in joints.items()}
        self._feeds: dict[tuple[str, ...], Feed] = {}  # by the names of a message
        self._names: tuple[str, ...] = ()  # of the last message, and their feed
        self._feed = Feed([], {})
        self._feedback_stamps: dict[str, Stamps] = {}  # of each axis, as last believed
        self._reader = JointStateReader()
        self._next_feedback = _taker(subscribe(JointState, 'joint_states', feedback_qos))
        self._next_emergency_stop = _taker(subscribe(Bool, '~/emergency_stop', 10))
        self._wires: dict[str, list[Wire]] = {name: [] for name in axes}

    def wire(self, name: str, topics: Mapping[Input, str]) -> None:
        """Subscribe to the inputs that an axis's parameters name; '' is the input's own topic.

        What stays as it is keeps its subscription: nothing it says is missed. Raises
        InvalidParameters, and changes nothing, where a topic cannot be subscribed to.
        """
        p = self._axes[name].parameters
        wanted = {
            source: (topics.get(source) or f'~/{name}/{source}', p.inverted(source))
            for source in p.inputs
        }
        old = self._wires[name]
        wires = {
            wire.source: wire
            for wire in old
            if wanted.get(wire.source) == (wire.topic, wire.inverted)
        }
        faults = []
        for source, (topic, inverted) in wanted.items():
            if source in wires:
                continue
            try:
                wires[source] = self._connect(source, topic, inverted)
            except ValueError as error:
                faults.append(f'{name}.topics.{source}: {error}')
        self._wires[name] = old if faults else [wires[source] for source in wanted]
        for wire in {*old, *wires.values()}.difference(self._wires[name]):
            self._destroy(wire.subscription)
        if faults:
            raise InvalidParameters(faults)
        for wire in self._wires[name]:
            wire.stamps.limit = p.feedback_timeout
        for feed in self._feeds.values():
            feed.regroup()

    def _connect(self, source: Input, topic: str, inverted: bool) -> Wire:
        kind = Float64 if source in LATCHES else Bool
        depth = 10 if source is Input.SERVO_ENABLED else 100
        subscription = self._subscribe(kind, topic, depth)
        self._arrivals.watch(subscription)
        return Wire(source, topic, inverted, Stamps(0.0), subscription)

    def poll(self) -> None:
        """Give every message that has arrived to its axis, the feedback last."""
        self._clock.relate()
        if self._arrivals.pending():
            for name, wires in self._wires.items():
                for wire in wires:
                    while (taken := wire.take()) is not None:
                        self._take(self._axes[name], wire, *taken)
        while (taken := self._next_emergency_stop()) is not None:
            self._take_emergency_stop(*taken)
        while (taken := self._next_feedback()) is not None:
            self._take_feedback(*taken)

    def unready(self, name: str, publishers_of: Callable[[str], list[str]]) -> Outcome | None:
        """Return why an axis's topics forbid a run: too many publishers, or what is not heard.

        ``publishers_of`` names the nodes that publish a topic.
        """
        unpublished, unheard = [], []
        for wire in self._wires[name]:
            publishers = wire.subscription.get_publisher_count()
            if publishers > 1:
                topic = wire.subscription.topic_name
                nodes = ', '.join(publishers_of(topic))
                return Outcome(
                    Error.PublisherConflict,
                    (
                        f'axis {name}: {publishers} publishers on {topic}: {nodes} (one that was '
                        'killed stays listed for about 20 s)'
                    ),
                )
            if publishers == 0:
                unpublished.append(wire.name)
            elif not wire.heard and wire.source not in LATCHES:
                unheard.append(wire.name)
        if unpublished:
            return Outcome(
                Error.SwitchUnknown, f'axis {name}: nobody publishes {", ".join(unpublished)}'
            )
        if unheard:
            return Outcome(
                Error.SwitchUnknown, f'axis {name}: no message yet from {", ".join(unheard)}'
            )
        return None

    def watch(self) -> None:
        """Note which inputs have lost their publisher: that ends a run of their axis.

        The next poll looks at all inputs, told of messages or not.
        """
        self._arrivals.expect()
        for name, axis in self._axes.items():
            for wire in self._wires[name]:
                if wire.subscription.get_publisher_count() == 0:
                    wire.heard = False  # whoever comes next has to tell the level
                    if axis.running:
                        axis.stop(Error.SwitchStale, f'{wire.name} lost its publisher')

    def _take(self, axis: Axis, wire: Wire, data: bytes, info: Info) -> None:
        """Give a message of an input to the axis."""
        value = convert.data_of(data, wire.subscription.msg_type)
        if value is None:
            return
        wire.heard = True
        if wire.source in LATCHES:
            axis.latch(wire.source, value)
        elif wire.source is Input.SERVO_ENABLED:
            axis.enable(bool(value))
        else:
            clock = self._clock
            clock.relate()
            arrival = stamp = clock.polled
            if not clock.simulated:
                arrival = min(arrival, clock.time_of(info['received_timestamp']))
                stamp = clock.time_of(info['source_timestamp'])
            found = wire.stamps.believe(stamp, arrival)
            if found is not None:
                time, doubt = found
                if wire.stamps.late:
                    self._stop(axis, Error.SwitchStale, too_late(wire.name, wire.stamps))
                if doubt:
                    axis.warn(f'{wire.name}: {wire.stamps.warning}')
                elif clock.simulated:
                    doubt = UNSTAMPED * axis.period
                axis.switch(wire.source, time, bool(value), arrival, doubt)

    def _take_emergency_stop(self, data: bytes, _: Info) -> None:
        value = convert.data_of(data, Bool)
        for axis in self._axes.values():
            axis.set_emergency_stop(value is not False)  # what cannot be read is no all-clear

    def _take_feedback(self, data: bytes, info: Info) -> None:
        read = self._reader.read(data)
        if read is None:
            return
        sampled, names, positions = read
        clock = self._clock
        clock.relate()
        arrival = sent = stamp = clock.polled
        if not clock.simulated:
            arrival = min(arrival, clock.time_of(info['received_timestamp']))
            sent = stamp = clock.time_of(info['source_timestamp'])
        if sampled:
            stamp = clock.time_of(sampled)
        if names is not self._names:
            self._names, self._feed = names, self._feed_of(names)
        known = len(positions)
        for stamps, places in self._feed.groups:
            found = stamps.believe(stamp, arrival, sent)
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

    def _stop(self, axis: Axis, error: Error, text: str) -> None:
        """End a run for a message that was too late, or for what made it late: our own hold-up."""
        hold_up = self._hold_up(self._clock.elapsed)
        axis.stop(Error.CycleLate if hold_up else error, hold_up or text)

    def _feed_of(self, names: tuple[str, ...]) -> Feed:
        """Return the feed of a list of joints, which may be met for the first time."""
        if names in self._feeds:
            return self._feeds[names]
        if len(self._feeds) >= MANY_FEEDS:
            del self._feeds[next(iter(self._feeds))]
        feed = self._feeds[names] = Feed(
            [
                (place, self._by_joint[name])
                for place, name in enumerate(names)
                if name in self._by_joint
            ],
            self._feedback_stamps,
        )
        return feed


def _taker(subscription: Any) -> Take:
    """Return what takes a subscription's next message; serialized, which costs half if none is."""
    return partial(subscription.handle.take_message, subscription.msg_type, True)
