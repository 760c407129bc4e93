# SPDX-License-Identifier: Apache-2.0
"""The facts about a running system that the rules judge: plain values, in SI units.

``homing_node.ros.doctor`` and the node itself collect them; a test writes them down.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.states import Input


class Endpoint(NamedTuple):
    """A publisher or a subscription: the full name of its node, its message type and its QoS.

    ``definition`` tells the fields of the message type; '' where that is not known.
    """

    node: str
    kind: str = ''
    reliable: bool = True
    latched: bool = False  # durability transient_local
    definition: str = ''

    @property
    def qos(self) -> str:
        """Name the two policies that must fit."""
        return (
            f'{"reliable" if self.reliable else "best_effort"}, '
            f'{"transient_local" if self.latched else "volatile"}'
        )


class Setpoints(NamedTuple):
    """The setpoints of a homing node.

    ``interface`` is the value of `setpoint_interface`, ``joints`` are those of an array of
    positions in its order (`position_joints`), ``axes`` the name and the parameters of the axis of
    each homed joint, ``rate`` is the rate of the messages in Hz.
    """

    topic: str
    interface: str
    joints: tuple[str, ...]
    axes: Mapping[str, tuple[str, AxisParameters]]
    rate: float


class Controller(NamedTuple):
    """A node that subscribes to the setpoints.

    ``parameters`` is None where they cannot be read. ``state`` is the label of its lifecycle
    state, '' where nobody tells it. ``claimed`` lists the command interfaces that it holds, None
    where that is not known.
    """

    node: str
    parameters: Mapping[str, Any] | None = None
    state: str = ''
    claimed: tuple[str, ...] | None = None


class Manager(NamedTuple):
    """A controller manager.

    ``claims`` lists the command interfaces that each active controller holds, by the full name of
    its node; None: the package controller_manager_msgs is not installed.
    """

    node: str
    parameters: Mapping[str, Any] | None = None
    claims: Mapping[str, tuple[str, ...]] | None = None


class Heard(NamedTuple):
    """The messages of one topic while the doctor listened.

    ``arrivals`` and ``sent`` are times in s on this host's clock and on the publisher's clock.
    ``values`` are the data of each message.
    """

    arrivals: tuple[float, ...] = ()
    sent: tuple[float, ...] = ()
    values: tuple[float, ...] = ()

    @property
    def delay(self) -> float | None:
        """The smallest difference between arrival and sending, s; None where it is not known."""
        pairs = [(a, s) for a, s in zip(self.arrivals, self.sent, strict=True) if s]
        return min(a - s for a, s in pairs) if pairs else None

    @property
    def gaps(self) -> list[float]:
        """The times between messages, s."""
        return [b - a for a, b in zip(self.arrivals, self.arrivals[1:], strict=False)]


class Topic(NamedTuple):
    """The topic of an input: its publishers, the node's own subscription, its messages.

    ``expression`` says what in the messages is the input, '' where that is the field `data`.
    ``problem`` says why the expression does not fit the type of the messages, ``missing`` why the
    last message did not say the input; '' where all is well.
    """

    name: str
    publishers: tuple[Endpoint, ...] = ()
    subscription: Endpoint | None = None
    heard: Heard = Heard()
    expression: str = ''
    problem: str = ''
    missing: str = ''

    @property
    def signal(self) -> str:
        """The topic, and what in its messages is the input."""
        return f'{self.name}#{self.expression}' if self.expression else self.name


class Sample(NamedTuple):
    """One message of the feedback; ``stamp`` is its header stamp in s, 0 where it has none.

    ``topic`` is where it came from.
    """

    arrival: float
    sent: float
    stamp: float
    positions: Mapping[str, float]
    topic: str = ''


class Facts(NamedTuple):
    """Everything that the doctor found out about one homing node.

    ``feedback`` is joint_states, ``own_feedback`` the topic of the feedback of each axis that has
    one of its own; ``samples`` has the messages of all of them.
    ``twins`` counts the nodes of this name; ``listened`` is how long the doctor listened in s;
    ``lags`` has the lag of each axis's drive in s, where a layout file tells it.
    """

    node: str
    setpoints: Setpoints
    publishers: tuple[Endpoint, ...]
    controllers: tuple[Controller, ...]
    feedback: Topic
    samples: tuple[Sample, ...] = ()
    inputs: Mapping[tuple[str, Input], Topic] = {}
    own_feedback: Mapping[str, Topic] = {}
    managers: tuple[Manager, ...] = ()
    sim_time: bool = False
    twins: int = 1
    listened: float = 0.0
    lags: Mapping[str, float] = {}
