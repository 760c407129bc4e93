"""The node's subscriptions, polled by the cycle: messages and their stamps to the axes."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from . import convert
from .axis import Axis, Outcome
from .stamps import Stamps
from .states import LATCHES, Error, Input
from .timebase import TimeBase

#: Samples of feedback in a row that may have overtaken each other.
REORDERED = 2

Info = Mapping[str, int]  # what the middleware tells of a message
Subscribe = Callable[[Any, str, Any], Any]  # (message type, topic, QoS) -> a polled subscription


class Wire(NamedTuple):
    """One wired input of an axis."""

    source: Input
    subscription: Any
    take: Callable[[Any, Info], None]


class Inputs:
    """All inputs of all axes.

    ``feedback_qos`` is the QoS of `joint_states`; ``destroy`` undoes ``subscribe``.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        clock: TimeBase,
        subscribe: Subscribe,
        destroy: Callable[[Any], object],
        feedback_qos: Any,
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._subscribe, self._destroy = subscribe, destroy
        self._by_joint = {
            joint: (axes[axis], Stamps(axes[axis].parameters.feedback_timeout, REORDERED))
            for axis, joint in joints.items()}
        self._feedback = subscribe(JointState, 'joint_states', feedback_qos)
        self._emergency_stop = subscribe(Bool, '~/emergency_stop', 10)
        self._wires: dict[str, list[Wire]] = {name: [] for name in axes}

    def wire(self, name: str, topics: Mapping[Input, str]) -> None:
        """Subscribe to the inputs that an axis's parameters name; '' is the input's own topic."""
        axis = self._axes[name]
        for wire in self._wires[name]:
            self._destroy(wire.subscription)
        self._wires[name] = []
        for source in axis.parameters.inputs:
            kind = Float64 if source in LATCHES else Bool
            depth = 10 if source is Input.SERVO_ENABLED else 100
            topic = topics.get(source) or f'~/{name}/{source}'
            self._wires[name].append(
                Wire(source, self._subscribe(kind, topic, depth), self._taker(axis, source)))

    def poll(self) -> None:
        """Give every message that has arrived to its axis, the feedback last."""
        for wires in self._wires.values():
            for _, subscription, take in wires:
                _drain(subscription, take)
        _drain(self._emergency_stop, self._take_emergency_stop)
        _drain(self._feedback, self._take_feedback)

    def unready(
        self, name: str, publishers_of: Callable[[str], list[str]]
    ) -> Outcome | None:
        """Return why an axis's topics forbid a run: too many publishers, or none of a latch.

        ``publishers_of`` names the nodes that publish a topic.
        """
        for source, subscription, _ in self._wires[name]:
            publishers = subscription.get_publisher_count()
            topic = subscription.topic_name
            if publishers > 1:
                nodes = ', '.join(publishers_of(topic))
                return Outcome(Error.PublisherConflict, (
                    f'axis {name}: {publishers} publishers on {topic}: {nodes} (one that was '
                    'killed stays listed for about 20 s)'))
            if publishers == 0 and source in LATCHES:
                return Outcome(Error.SwitchUnknown, f'axis {name}: nobody publishes {topic}')
        return None

    def watch(self) -> None:
        """End the run of an axis one of whose inputs has lost its publisher."""
        for name, axis in self._axes.items():
            if not axis.running:
                continue
            for source, subscription, _ in self._wires[name]:
                if subscription.get_publisher_count() == 0:
                    axis.stop(Error.SwitchStale,
                              f'{source} lost its publisher ({subscription.topic_name})')

    def _taker(self, axis: Axis, source: Input) -> Callable[[Any, Info], None]:
        """Return what gives a message of an input to the axis."""
        if source in LATCHES:
            return lambda message, info: axis.latch(source, float(message.data))
        if source is Input.SERVO_ENABLED:
            return lambda message, info: axis.enable(bool(message.data))
        stamps = Stamps(axis.parameters.feedback_timeout)
        clock = self._clock

        def take(message: Bool, info: Info) -> None:
            arrival = stamp = clock.now
            if not clock.simulated:
                arrival = clock.time_of(info['received_timestamp'])
                stamp = clock.time_of(info['source_timestamp'])
            found = stamps.believe(stamp, arrival)
            if found is not None:
                axis.switch(source, found[0], bool(message.data), arrival)

        return take

    def _take_emergency_stop(self, message: Bool, _: Info) -> None:
        for axis in self._axes.values():
            axis.set_emergency_stop(bool(message.data))

    def _take_feedback(self, message: JointState, info: Info) -> None:
        clock = self._clock
        arrival = stamp = clock.now
        if not clock.simulated:
            arrival = clock.time_of(info['received_timestamp'])
            stamp = clock.time_of(info['source_timestamp'])
        sampled = convert.to_nanoseconds(message.header.stamp)
        if sampled:
            stamp = clock.time_of(sampled)
        for joint, position in convert.positions(message):
            if joint in self._by_joint:
                axis, stamps = self._by_joint[joint]
                found = stamps.believe(stamp, arrival)
                if found is not None:
                    axis.feedback(found[0], position, arrival)


def _drain(subscription: Any, take: Callable[[Any, Info], None]) -> None:
    handle, kind = subscription.handle, subscription.msg_type
    while (taken := handle.take_message(kind, False)) is not None:
        take(*taken)
