# SPDX-License-Identifier: Apache-2.0
"""The node's subscriptions, polled by the cycle: messages and their stamps to the axes.

A topic has one subscription, however many inputs come from it (feeds.py). Its type and its QoS
follow its publishers (adapting.py): the cycle notices that they have changed, and the executor
looks at the graph and subscribes anew.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..core.position_array import OtherJoint
from ..diagnosis.facts import Endpoint
from ..parameters.connections import FEEDBACK, TEMPERATURE, Connections
from ..parameters.definition import InvalidParameters
from ..parameters.wiring import Place, Wiring
from ..procedures.states import LATCHES, Error, Input
from . import messages
from .adapting import Asked, adapted, mismatch
from .feeds import Feed
from .joint_feedback import JointFeedback
from .message_types import message_class
from .polling import Info, Take, taker, waiting
from .subscriptions import qos
from .timebase import TimeBase
from .wired_input import WiredInput


class Graph(Protocol):
    """Makes subscriptions, and shows publishers; see subscriptions.py."""

    def resolve(self, topic: str) -> str: ...
    def subscribe(self, kind: Any, topic: str, profile: Any, overridable: bool = True) -> Any: ...
    def destroy(self, subscription: Any) -> None: ...
    def offers(self, topic: str) -> tuple[Endpoint, ...]: ...
    def count(self, topic: str) -> int: ...
    def asked(self, topic: str, kind: str) -> Endpoint | None: ...


class Inputs:
    """All inputs of all axes.

    ``graph`` makes the subscriptions. ``late_cycle(late)`` returns the message of CycleLate if a
    cycle so late (s) ends a run, else ''. ``serialized``: read joint states from their bytes.
    ``lock`` guards the axes.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        clock: TimeBase,
        graph: Graph,
        late_cycle: Callable[[float], str],
        lock: threading.Lock,
        serialized: bool = True,
    ) -> None:
        self._axes, self._joints = axes, joints
        self._clock, self._graph, self._lock = clock, graph, lock
        self._late_cycle = late_cycle
        self._wired: dict[str, list[WiredInput]] = {name: [] for name in axes}
        self._feeds: dict[str, Feed] = {}
        self._polled: list[tuple[Take, Feed]] = []
        self._looking = False
        self._turns: Iterator[str] = iter(())  # the topics whose publishers are counted next
        self.joint_feedback = JointFeedback(serialized)
        self._joint_states: Any = None
        self._next_joint_states: Take = lambda: None
        # A late joiner hears what was published before only of a publisher that is reliable and
        # keeps it, and nothing of one that is not reliable where it asks for that.
        self._emergency_stops = [
            taker(graph.subscribe(Bool, '~/emergency_stop', profile, overridable), True)
            for profile, overridable in (
                (qos(), True),
                (qos(latched=True), False),
                (qos(reliable=False), False),
            )
        ]

    # ------------------------------------------------------------------------------------- wiring

    def wire(self, name: str, connections: Connections) -> None:
        """Subscribe to the inputs that an axis's parameters name.

        An input whose source has not changed keeps its subscription: no message of it is missed.

        Args:
            name: The axis.
            connections: Where its inputs come from.

        Raises:
            InvalidParameters: A topic cannot be subscribed to, or an expression does not fit the
                type that was told; nothing has changed then.
        """
        if FEEDBACK not in connections.sources:
            self._listen_to_joint_states()
        axis = self._axes[name]
        before = {one.source: one for one in self._wired[name]}
        wanted: list[WiredInput] = []
        names: list[str] = [*axis.parameters.inputs]
        names += [one for one in (FEEDBACK, TEMPERATURE) if one in connections.sources]
        for source in names:
            written = connections.source(name, source)
            told = connections.types.get(source, '')
            try:
                topic = self._graph.resolve(written.topic)
            except ValueError as error:
                raise InvalidParameters([f'{name}.topics.{source}: {error}']) from None
            one = WiredInput(axis, source, written, told, topic)
            old = before.get(source)
            same = old and (old.written, old.told, old.topic) == (written, told, one.topic)
            wanted.append(old if old and same else one)
        old_wired, self._wired[name] = self._wired[name], wanted
        try:
            self._feed()
        except InvalidParameters:
            self._wired[name] = old_wired
            self._feed()
            raise
        shared = [self._axes[axis] for axis, wired in self._wired.items() if not _own(wired)]
        self.joint_feedback.serve({self._joints[axis.name]: axis for axis in shared})

    def serve_others(self, others: Mapping[str, OtherJoint]) -> None:
        """Give feedback to joints that no axis homes, by their names; before the first poll."""
        self.joint_feedback.others = others
        if others:
            self._listen_to_joint_states()

    def _listen_to_joint_states(self) -> None:
        if self._joint_states is None:
            self._joint_states = self._graph.subscribe(
                JointState, 'joint_states', qos(reliable=False)
            )
            self._next_joint_states = taker(self._joint_states, True)

    def _feed(self) -> None:
        """Make the feeds fit the wired inputs."""
        by_topic: dict[str, list[WiredInput]] = {}
        for wired in self._wired.values():
            for one in wired:
                by_topic.setdefault(one.topic, []).append(one)
        faults: list[str] = []
        for topic, inputs in by_topic.items():
            feed = self._feeds.setdefault(topic, Feed(topic))
            if feed.inputs != inputs:
                feed.inputs = inputs
                feed.looked = False
                faults += self._start(feed)
            elif feed.subscription is not None:
                feed.regroup()
        for topic in [topic for topic, feed in self._feeds.items() if topic not in by_topic]:
            self._end(self._feeds.pop(topic))
        self._order()
        if faults:
            raise InvalidParameters(faults)

    def _order(self) -> None:
        """Note what is polled: the feedback last."""
        fed = [feed for feed in self._feeds.values() if feed.subscription is not None]
        self._polled = [(f.take, f) for f in sorted(fed, key=lambda feed: feed.feeds_axes)]

    def _start(self, feed: Feed) -> list[str]:
        """Subscribe to a topic whose type is known; return what is wrong."""
        default = feed.default()
        if isinstance(default, str):
            return [f'{feed.inputs[-1].axis.name}.types.{feed.inputs[-1].source}: {default}']
        old = feed.subscription
        if default.kind and (old is None or (feed.told and default.kind != feed.asked.kind)):
            self._end(feed)
            try:
                new = self._subscription(feed, default)
                feed.subscribe(new, default, self._clock.polled)
            except (ValueError, LookupError) as error:
                return [f'{_parameter(feed.inputs[-1])}: {error}']
        feed.bind()
        told = [one for one in feed.inputs if one.problem and feed.told]
        return [f'{_parameter(one)}: {one.problem}' for one in told]

    def _end(self, feed: Feed) -> None:
        """End the subscription of a topic, if there is one."""
        if feed.subscription is not None:
            self._graph.destroy(feed.subscription)
            feed.unsubscribe()

    def _subscription(self, feed: Feed, asked: Asked) -> Any:
        profile = qos(asked.reliable, asked.latched)
        try:
            kind = message_class(asked.kind)
        except LookupError as error:
            raise LookupError(f'the type {asked.kind} is not installed here: {error}') from None
        return self._graph.subscribe(kind, feed.inputs[0].written.topic, profile)

    @property
    def wiring(self) -> Wiring:
        """Which signal each wired input reads, by the full names of the topics."""
        return Wiring(
            {
                Place(axis, Input(one.source)): one.written.at(one.topic)
                for axis, inputs in self._wired.items()
                for one in inputs
                if not (one.is_feedback or one.is_temperature)
            }
        )

    # ----------------------------------------------------------------------------------- adapting

    def watch(self) -> bool:
        """Note which topics have lost their publisher; return whether to look at the graph.

        Publishers that do not match are counted of one topic at a time: in a graph of many nodes
        that takes some 100 µs.
        """
        wanted = False
        turn = next(self._turns, None)
        if turn is None:
            self._turns = iter([*self._feeds])
        for feed in self._feeds.values():
            count = feed.count()
            offered = self._graph.count(feed.topic) if feed.topic == turn else feed.offered
            if (count, offered) != (feed.publishers, feed.offered):
                feed.publishers, feed.offered, feed.looked = count, offered, False
            if not count:
                feed.silence()
            wanted = wanted or not (count and feed.looked)
        look, self._looking = wanted and not self._looking, wanted or self._looking
        return look

    def look(self) -> None:
        """Make subscriptions fit the publishers that the graph shows; the lock is not held."""
        try:
            for feed in [*self._feeds.values()]:
                if feed.publishers and (feed.looked or feed.in_use):
                    continue
                # A subscription takes some ms to make, which the cycle of a run would miss.
                if feed.heard and any(axis.running for axis in self._axes.values()):
                    continue
                offers = self._graph.offers(feed.topic)
                if offers:
                    self._adapt(feed, offers)
                else:
                    feed.problem, feed.unfit = '', False
        finally:
            self._looking = False

    def _adapt(self, feed: Feed, offers: tuple[Endpoint, ...]) -> None:
        asked = adapted(offers, feed.asked, feed.told, feed.matters)
        if isinstance(asked, str):
            feed.problem, feed.unfit = asked, True
            return
        old = feed.subscription
        if old is None or asked != feed.asked:
            if asked.kind != feed.asked.kind:  # a node has a topic of one type only
                with self._lock:
                    self._end(feed)
                    self._order()
                old = None
            try:
                new = self._subscription(feed, asked)
            except (ValueError, LookupError) as error:
                feed.problem, feed.unfit = str(error), True
                return
            with self._lock:
                late = feed.publishers and feed.in_use  # a run has begun meanwhile
                if not late:
                    self._drain(feed)
                    feed.subscribe(new, asked, self._clock.polled)
                    feed.bind()
                    self._order()
            if late or old is not None:
                self._graph.destroy(new if late else old)
            if late:
                return
        own = self._graph.asked(feed.topic, asked.kind)
        feed.problem, feed.unfit = mismatch(offers, own) if own else '', False
        feed.looked = bool(feed.publishers)

    # -------------------------------------------------------------------------------- each cycle

    def poll(self) -> None:
        """Give the messages that have arrived to their axes, the feedback last."""
        self._clock.relate()
        for take, feed in self._polled:
            taken = take()  # most are silent most of the time
            if taken is not None and feed.receive(*taken, self._clock, self._stop):
                self._drain(feed)
        for take in self._emergency_stops:
            for data, info in waiting(take):
                self._take_emergency_stop(data, info)
        for data, info in waiting(self._next_joint_states):
            self.joint_feedback.receive(data, info, self._clock, self._stop)

    def _drain(self, feed: Feed) -> None:
        """Give the messages that wait to the axes; those behind a broken one wait for a cycle."""
        for data, info in waiting(feed.take):
            if not feed.receive(data, info, self._clock, self._stop):
                return

    def _take_emergency_stop(self, data: bytes, _: Info) -> None:
        value = messages.data_of(data, Bool)
        for axis in self._axes.values():
            axis.set_emergency_stop(value is not False)  # what cannot be read is no all-clear

    def _stop(self, axis: Axis, error: Error, text: str) -> None:
        """End a run for a message that was too late, or for the late cycle that made it late."""
        late_cycle = self._late_cycle(self._clock.elapsed)
        axis.stop(Error.CycleLate if late_cycle else error, late_cycle or text)

    # ------------------------------------------------------------------------------ what is there

    def conflict(self, name: str, publishers_of: Callable[[str], list[str]]) -> Outcome | None:
        """Return what of an axis's inputs is wrong, and not only missing; else None.

        ``publishers_of`` returns the names of the nodes that publish a topic.
        """
        axis = self._axes[name]
        conflict = axis.readings.conflict(axis.parameters.joint or name)
        if conflict is not None:
            topic = self.feedback_topic_of(name)
            nodes = ', '.join(publishers_of(topic))
            return Outcome(
                conflict.error,
                f'axis {name}: {conflict.seen} {topic} is published by {nodes}',
            )
        for one in self._needed(name):
            feed = self._feeds[one.topic]
            count = max(feed.count(), self._graph.count(one.topic))
            if count > 1 and not one.is_feedback:
                return Outcome(
                    Error.PublisherConflict,
                    f'axis {name}: {count} publishers on {one.topic}: '
                    f'{", ".join(publishers_of(one.topic))} (one that was killed stays listed '
                    'for about 20 s)',
                )
            if feed.problem:
                error = Error.InvalidParameter if feed.unfit else Error.SwitchUnknown
                return Outcome(error, f'axis {name}: {one.name}: {feed.problem}')
            if one.problem:
                text = f'axis {name}: {_parameter(one)}: {one.problem}'
                return Outcome(Error.InvalidParameter, text)
        return None

    def _needed(self, name: str) -> list[WiredInput]:
        """Return the inputs without which an axis does not home."""
        return [one for one in self._wired[name] if not one.is_temperature]

    def sources(self, name: str) -> dict[str, str]:
        """Return where each input of an axis comes from."""
        return {
            one.source: one.written.at(one.topic)
            for one in self._wired[name]
            if not one.is_feedback
        }

    def feedback_topic_of(self, name: str) -> str:
        """Return the full name of the topic of an axis's feedback."""
        for one in self._wired[name]:
            if one.is_feedback:
                return one.topic
        return str(self._joint_states.topic_name)

    def missing(self, name: str) -> list[Outcome]:
        """Return everything that is not there yet of an axis: publishers, levels, feedback."""
        unpublished, unheard, unsaid = [], [], []
        for one in self._needed(name):
            if not self._feeds[one.topic].count():
                unpublished.append(one.name)
            elif one.missing:
                unsaid.append(f'{one.name}: {one.missing}')
            elif not one.heard and not one.is_feedback and _must_be_heard(one):
                unheard.append(one.name)
        found = []
        if unpublished:
            found.append(f'nobody publishes {", ".join(unpublished)}')
        if unheard:
            found.append(f'no message yet from {", ".join(unheard)}')
        found += unsaid
        missing = [Outcome(Error.SwitchUnknown, f'axis {name}: {text}') for text in found]
        if not self._axes[name].readings.known:
            joint = self._axes[name].parameters.joint or name
            text = f'axis {name}: no feedback yet for joint {joint!r}'
            missing.append(Outcome(Error.FeedbackStale, text))
        return missing


def _own(wired: list[WiredInput]) -> bool:
    """Return whether an axis has feedback of its own, and none from joint_states."""
    return any(one.is_feedback for one in wired)


def _must_be_heard(one: WiredInput) -> bool:
    """Return whether a run needs to know a value before it starts: a latch comes later."""
    return one.source not in LATCHES or one.written.counter is not None


def _parameter(one: WiredInput) -> str:
    return f'{one.axis.name}.topics.{one.source}'
