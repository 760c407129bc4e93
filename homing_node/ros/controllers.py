# SPDX-License-Identifier: Apache-2.0
"""Watches the controllers behind the setpoints, in the background.

The cycle calls `watch`, which is cheap; everything else happens in callbacks of the executor. Who
subscribes is read from the graph, parameters come from the parameter services, the lifecycle state
from the controller's own transitions (every ros2_control controller publishes them), from its
`get_state` service, or from the controller manager. Nothing waits for an answer.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import GetState
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ..check.finding import Finding, Severity
from ..core.outcome import Outcome
from ..diagnosis.controller import ACTIVE, is_known, judge_controller
from ..diagnosis.facts import Controller, Setpoints
from ..diagnosis.listeners import listens, others
from ..procedures.states import Error
from . import graph, managers
from .asking import Parameters, Question, of_interest
from .managers import ManagerList

#: How long a node that subscribes may take to answer, s. One that has no parameter services is
#: then taken for a controller that nothing is known of.
PATIENCE = 1.0
#: How often questions that are open are looked at, s.
LOOK_PERIOD = 0.05
#: How often the graph is read though no count has changed: a controller may have been loaded anew.
READ_PERIOD = 1.0
#: How often the controller manager is asked while a run is on, s.
ASK_PERIOD = 0.1


class Verdict(NamedTuple):
    """What the controllers mean for a run: why it is refused, or what it still waits for."""

    wrong: Outcome | None = None
    missing: tuple[Outcome, ...] = ()
    proven: bool = False  # the joints of the controller, and their order, are known to be right


class Listener:
    """One node that subscribes to the setpoints: its parameters and its lifecycle state."""

    def __init__(self, node: Node, name: str, ids: frozenset[bytes], changed: Any) -> None:
        self.name, self.ids = name, ids
        self.state = ''
        self.claimed: tuple[str, ...] | None = None
        self.managed = False  # the managers have been asked since it came
        self.told: set[tuple[str, str]] = set()  # findings that were logged
        self._node, self._changed = node, changed
        self._parameters = Parameters(node, name, of_interest, PATIENCE)
        self._asking = Question(node, GetState, f'{name}/get_state', GetState.Request(), PATIENCE)
        self._transitions = node.create_subscription(
            TransitionEvent, f'{name}/transition_event', self._take_transition, 10
        )

    @property
    def facts(self) -> Controller:
        """What is known of it."""
        return Controller(self.name, self._parameters.values, self.state, self.claimed)

    @property
    def read(self) -> bool:
        """Whether its parameters were read and its manager has answered, if they ever do."""
        return self._parameters.done and self.managed

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return not (self.read and self._asking.done)

    def poll(self) -> None:
        """Go on asking."""
        self._parameters.poll()
        if not self._asking.done and self._asking.poll() and self._asking.answer is not None:
            self.state = self.state or self._asking.answer.current_state.label

    def close(self) -> None:
        """Ask and listen no more."""
        self._parameters.close()
        self._asking.close()
        self._node.destroy_subscription(self._transitions)

    def _take_transition(self, event: TransitionEvent) -> None:
        before, self.state = self.state, event.goal_state.label
        if before != self.state:
            self._changed(self, f'became {self.state}')


class Controllers:
    """Who plays the setpoints, and whether a run may start.

    Args:
        node: The homing node.
        publisher: The publisher of the setpoints.
        setpoints: What the rules must know of the setpoints; called at each judgement.
        running: Tells whether a run is on.
        lost: Ends all runs, with an outcome.
        relays: Returns the nodes that publish beside the homing node, but not during a run.
    """

    def __init__(
        self,
        node: Node,
        publisher: Any,
        setpoints: Callable[[], Setpoints],
        running: Callable[[], bool],
        lost: Callable[[Outcome], None],
        relays: Callable[[], set[str]] = set,
    ) -> None:
        self._node, self._publisher = node, publisher
        self._setpoints, self._running, self._lost = setpoints, running, lost
        self._relays = relays
        self._listeners: dict[str, Listener] = {}
        self._asking: list[Listener] = []  # those that were there when the managers were asked
        self._managers: dict[str, ManagerList] = {}  # by the service
        self._counts = (-1, -1)
        self._twins = False  # another node has our name
        self._read = self._ask = 0.0
        self._open = False  # the managers were asked, their answers are not all taken
        #: Replaced as a whole: the cycle may read it at any time.
        self.verdict = Verdict(missing=(_nobody(publisher.topic_name),))
        self._timer = node.create_timer(
            LOOK_PERIOD, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def watch(self) -> bool:
        """Tell whether somebody must look: cheap, for the cycle; `look` is for the executor."""
        counts = (
            self._publisher.get_subscription_count(),
            self._node.count_publishers(self._publisher.topic_name),
        )
        now = time.monotonic()
        due = counts != self._counts or now > self._read + READ_PERIOD
        if self._managers and (self._running() or self.verdict.missing):
            due = due or now > self._ask + ASK_PERIOD
        self._counts = counts
        return due

    def conflict(self) -> Outcome | None:
        """Return who else publishes the setpoints now, else None."""
        topic, own = self._publisher.topic_name, self._node.get_fully_qualified_name()
        second: list[str] = []
        if self._node.count_publishers(topic) > 1:
            second = others(own, graph.publishers(self._node, topic), self._relays())
        elif self._twins:  # a discovery server tells nobody of a topic that it publishes only
            second = [own]
        if not second:
            return None
        return Outcome(
            Error.PublisherConflict,
            f'{topic} is published by {", ".join(second)}, too (one that was killed stays listed '
            'for about 20 s)',
        )

    def look(self) -> None:
        """Read the graph, go on with the questions, and judge."""
        now = time.monotonic()
        self._read = now
        self._read_graph()
        conflict = self.conflict()
        if conflict is not None:
            self._end(conflict)
        for listener in self._listeners.values():
            listener.poll()
        self._ask_managers(now)
        self._judge()
        if self._open or any(one.busy for one in self._listeners.values()):
            if self._timer.is_canceled():
                self._timer.reset()
        else:
            self._timer.cancel()

    def _read_graph(self) -> None:
        found: dict[str, set[bytes]] = {}
        topic, own = self._publisher.topic_name, self._node.get_fully_qualified_name()
        self._twins = graph.node_names(self._node).count(own) > 1
        for info in self._node.get_subscriptions_info_by_topic(topic):
            name = graph.full_name(info.node_namespace, info.node_name)
            found.setdefault(name, set()).add(bytes(info.endpoint_gid))
        for name, listener in list(self._listeners.items()):
            if frozenset(found.get(name, ())) != listener.ids:
                del self._listeners[name]
                listener.close()
                if is_known(listener.facts, self._setpoints().interface):
                    self._end(_no_controller(f'{name} no longer subscribes to {topic}'))
        for name, ids in found.items():
            if name not in self._listeners and listens(Controller(name)):
                self._node.get_logger().info(f'the setpoints on {topic} go to {name}')
                self._listeners[name] = Listener(
                    self._node, name, frozenset(ids), self._take_change
                )
        if not self._listeners:
            self._end(_no_controller(f'nobody subscribes to {topic} any more'))

    def _ask_managers(self, now: float) -> None:
        """Ask the managers, if there are any; take what they have answered."""
        if self._open:
            if all(one.poll() for one in self._managers.values()):
                self._open = False
                for manager in self._managers.values():
                    for name, known in (manager.controllers or {}).items():
                        self._take_known(name, known)
                for listener in self._asking:
                    listener.managed = True
            return
        urgent = self._running() or self.verdict.missing
        if now < self._ask + (ASK_PERIOD if urgent else READ_PERIOD):
            return
        self._ask, self._open = now, True
        self._asking = list(self._listeners.values())
        services = managers.services(self._node)
        for name in self._managers.keys() - services:
            self._managers.pop(name).close()
        for name in services:
            if name in self._managers:
                self._managers[name].ask()
            else:
                self._managers[name] = ManagerList(self._node, name, PATIENCE)

    def _take_known(self, name: str, known: managers.Known) -> None:
        """Take what a manager says of a controller."""
        listener = self._listeners.get(name)
        if listener is None:
            return
        before, listener.state = listener.state, known.state
        listener.claimed = known.claimed
        if before and before != known.state:
            self._take_change(listener, f'became {known.state}')

    def _take_change(self, listener: Listener, what: str) -> None:
        """End the runs for a controller that has left or entered `active` in their middle."""
        self._end(_no_controller(f'{listener.name} {what} during the run'))
        self._judge()

    def _end(self, outcome: Outcome) -> None:
        if self._running():
            self._lost(outcome)

    # ------------------------------------------------------------------------------- judgement

    def _judge(self) -> None:
        self.verdict = self._verdict()

    def _verdict(self) -> Verdict:
        topic = self._publisher.topic_name
        if not self._listeners:
            return Verdict(missing=(_nobody(topic),))
        setpoints = self._setpoints()
        unread = [one.name for one in self._listeners.values() if not one.read]
        # A recorder that comes later holds nobody up, unless a wrong order would be a jump.
        if unread and (setpoints.interface != 'trajectory' or len(unread) == len(self._listeners)):
            text = f'the parameters of {", ".join(unread)} are not read yet'
            return Verdict(missing=(_no_controller(text),))
        known = [
            one for one in self._listeners.values() if is_known(one.facts, setpoints.interface)
        ]
        active = [one for one in known if one.state in ('', ACTIVE)]
        if known and not active:
            states = ', '.join(f'{one.name} is {one.state}' for one in known)
            return Verdict(missing=(_no_controller(f'{states}, not active'),))
        faults = []
        for one in active:
            found = list(judge_controller(one.facts, setpoints))
            self._log(one, found)
            faults += [finding.text for finding in found if finding.severity is Severity.error]
        if faults:
            return Verdict(Outcome(Error.NoController, '; '.join(faults), final=True))
        return Verdict(proven=bool(active))

    def _log(self, listener: Listener, found: list[Finding]) -> None:
        for one in found:
            if one.severity is Severity.info or (one.check, one.what) in listener.told:
                continue
            listener.told.add((one.check, one.what))
            log = self._node.get_logger()
            text = f'{one.check}: {one.text} (homing doctor; doc/doctor.md)'
            log.error(text) if one.severity is Severity.error else log.warning(text)


def _no_controller(text: str) -> Outcome:
    return Outcome(Error.NoController, text)


def _nobody(topic: str) -> Outcome:
    return _no_controller(
        f'nobody subscribes to {topic}: is the controller loaded, and does it have this topic?'
    )
