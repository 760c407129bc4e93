# SPDX-License-Identifier: Apache-2.0
"""Carries out what the hand-overs of the axes ask: calls services, switches controllers, looks.

The rules stand in core/handover.py. The cycle calls `cycle`, which is cheap; all else happens in
callbacks of the executor, and nothing waits there. ``lock`` guards the axes.
"""

import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

from rcl_interfaces.srv import SetParameters
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from ..core.axis import Axis
from ..core.handover import Handover, may_begin
from ..core.handover import Question as Asked
from ..core.handover_steps import Asks, Step
from ..core.outcome import Outcome
from ..diagnosis.listeners import relay_of, relays_of
from ..parameters.applying import filled as request_fields
from ..parameters.axis import AxisParameters
from ..parameters.definition import InvalidParameters
from ..procedures.states import Apply, Error
from . import managers, requests
from .asking import Clients, Question
from .managers import ManagerList, Switch

#: How often open questions are looked at, and how often the managers are asked at rest, s.
LOOK_PERIOD, ASK_PERIOD = 0.01, 0.5
#: How long a manager may take to list its controllers, s.
PATIENCE = 1.0
#: How often the relay is told its home until it answers, s.
AGAIN = 0.3
#: The parameter of the relay that is the home of an axis.
HOME = '{axis}.home_offset'
DOUBLE = 3  # rcl_interfaces/msg/ParameterType
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class Task(Protocol):
    """Something that was asked: `poll` until it is over, then `close`."""

    def poll(self) -> bool:
        """Go on; return whether it is over."""

    def close(self) -> None:
        """Ask no more."""


class Handovers:
    """The hand-overs of all axes of a node.

    Raises InvalidParameters if a service cannot be called as the parameters say.
    """

    def __init__(
        self, node: Node, axes: Mapping[str, Axis], joints: Mapping[str, str], lock: threading.Lock
    ) -> None:
        self._node, self._axes, self._joints, self._lock = node, axes, joints, lock
        self._tasks: dict[str, tuple[int, Task]] = {}  # of each axis: the number, and who asks
        self._seen: dict[str, int] = {}  # the number of each axis that the cycle has seen last
        self._released: dict[str, int] = {}  # and the one that may be asked now
        self._managers: dict[str, ManagerList] = {}  # by their service
        self._listed: dict[str, dict[str, managers.Known]] = {}  # by the manager's node
        self._asked = 0.0
        self._clients = Clients(node)
        faults = []
        for name, axis in axes.items():
            axis.hands_over = True
            fault = self.fault(axis.parameters) or self._prepare(axis.parameters)
            faults += [f'{name}.{fault}'] if fault else []
        if faults:
            raise InvalidParameters(faults)
        self._timer = node.create_timer(
            LOOK_PERIOD, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    # ------------------------------------------------------------------------------ before a run

    @staticmethod
    def fault(p: AxisParameters) -> str:
        """Return why the home cannot be applied as the parameters say, '' if it can."""
        if p.switch_controllers and not managers.INSTALLED:
            return 'switch_controllers: the package controller_manager_msgs is not installed'
        if p.apply is Apply.service:
            name = 'apply_type'
            try:
                kind = requests.service_type(p.apply_type)
                name = 'apply_request'
                values = dict.fromkeys(('position', 'home_offset', 'home_offset_change'), 0.0)
                values |= dict.fromkeys(('raw_position', 'home_position_raw'), 0.0)
                _request(kind, p, {**values, 'uncertainty': 0.0}, 'axis', 'joint')
            except ValueError as error:
                return f'{name}: {error}'
        return ''

    def wrong(self, name: str) -> Outcome | None:
        """Return why the home of an axis cannot be applied, whatever comes; else None."""
        fault = self.fault(self._axes[name].parameters)
        return Outcome(Error.InvalidParameter, f'axis {name}: {fault}') if fault else None

    def missing(self, name: str) -> Outcome | None:
        """Return what a run of an axis must still wait for, else None."""
        for other, axis in self._axes.items():
            if axis.handover is not None and axis.handover.exclusive:
                text = f'the home of axis {other} is being applied'
                return Outcome(Error.NoController, f'axis {name}: {text}')
        nobody = self._nobody(self._axes[name].parameters)
        if nobody:
            return Outcome(Error.HandoverFailed, f'axis {name}: step {Step.Apply}: {nobody}')
        wanted = self._axes[name].parameters.switch_controllers
        known = managers.find(self._listed, wanted)
        faults = [
            f'{one} is {known[one][1].state}' if one in known else f'{one} is not known'
            for one in wanted
            if one not in known or known[one][1].state != managers.ON
        ]
        if not faults:
            return None
        text = f'{", ".join(faults)}: homing needs it active (switch_controllers)'
        return Outcome(Error.NoController, f'axis {name}: {text}')

    def _nobody(self, p: AxisParameters) -> str:
        """Return that nobody would take a home, '' where somebody is there."""
        if p.apply is Apply.none:
            return ''
        try:
            kind, service = self._service_of(p)
            there = self._clients.of(kind, service).service_is_ready()
        except ValueError as error:
            return f'apply_service: {error}'
        return '' if there else f'nobody serves {service} (apply, apply_service)'

    def relays(self) -> set[str]:
        """Return the full names of the relays that the axes name."""
        axes = (axis.parameters for axis in self._axes.values())
        return relays_of(self._node.get_fully_qualified_name(), axes)

    # --------------------------------------------------------------------------------- the cycle

    def cycle(self) -> Mapping[str, int] | None:
        """Let hand-overs begin. The lock is held.

        Returns:
            The numbers of what the axes ask now, if there is something new for `release`. It is
            called once the states of the axes are published: the relay then knows of the run.
        """
        going = {n: axis.handover for n, axis in self._axes.items() if axis.handover is not None}
        if not going:
            return {} if self._tasks or self._due() else None
        moving = any(axis.moving for axis in self._axes.values())
        begun = False
        for name, one in going.items():
            others = [other for n, other in going.items() if n != name]
            free = not begun and may_begin(one, others, moving)
            self._axes[name].free = free
            begun = begun or (free and one.exclusive and one.step is Step.Rest)
        numbers = {name: self._number(name) for name in going}
        if numbers == self._seen:
            return None
        self._seen = numbers
        return numbers

    def release(self, numbers: Mapping[str, int]) -> None:
        """Let what has these numbers be asked."""
        self._released = dict(numbers)

    def _number(self, name: str) -> int:
        """Return the number of what an axis asks, 0 for nothing."""
        handover = self._axes[name].handover
        return handover.question.number if handover and handover.question else 0

    # ------------------------------------------------------------------------------- the executor

    def look(self) -> None:
        """Ask what is to be asked, and take what was answered."""
        with self._lock:
            wanted = {
                name: (axis.handover, axis.handover.question)
                for name, axis in self._axes.items()
                if axis.handover is not None
                and axis.handover.question is not None
                and axis.handover.question.number == self._released.get(name)
            }
        for axis in self._axes.values():
            if axis.handover is not None:
                self._prepare(axis.parameters)  # they may have changed
        for name in list(self._tasks):
            if name not in wanted or wanted[name][1].number != self._tasks[name][0]:
                self._tasks.pop(name)[1].close()
        for name, (handover, asked) in wanted.items():
            if name not in self._tasks:
                self._tasks[name] = asked.number, self._start(name, handover, asked)
            self._tasks[name][1].poll()
        if self._ask_managers() or self._tasks:
            if self._timer.is_canceled():
                self._timer.reset()
        else:
            self._timer.cancel()

    def _start(self, name: str, handover: Handover, asked: Asked) -> Task:
        p = self._axes[name].parameters
        answer = partial(self._answer, handover, asked.number)
        if asked.asks is Asks.Call:
            return self._call(name, p, asked, answer)
        if asked.asks is Asks.Look:
            if p.apply is Apply.relay:
                return _Looking(self._node, self._relay_of(p), partial(self._shown, name))
            return _Nothing()
        on = asked.asks is Asks.Activate
        found = managers.find(self._listed, p.switch_controllers)
        unknown = [one for one in p.switch_controllers if one not in found]
        if unknown:
            answer(False, f'no controller manager knows {", ".join(unknown)}')
            return _Nothing()
        by_manager: dict[str, list[str]] = {}
        for one, (manager, _) in found.items():
            by_manager.setdefault(manager, []).append(one.rpartition('/')[2])
        return _Switching(
            [
                Switch(self._node, manager, names, on, p.apply_timeout, self._clients)
                for manager, names in by_manager.items()
            ],
            answer,
        )

    def _call(
        self, name: str, p: AxisParameters, asked: Asked, answer: Callable[[bool, str], None]
    ) -> Task:
        """Call the service of the driver, or set the parameter of the relay."""
        try:
            kind, service = self._service_of(p)
            again = 0.0
            if p.apply is Apply.relay:
                again = AGAIN  # that sets the same value once more
                value = {'type': DOUBLE, 'double_value': asked.values['home_offset']}
                one = {'name': HOME.format(axis=name), 'value': value}
                request = requests.filled(kind.Request(), {'parameters': [one]})
            else:
                request = _request(kind, p, asked.values, name, self._joints[name])
            question = Question(
                self._node, kind, service, request, p.apply_timeout, self._clients, again
            )
            return _Calling(question, answer)
        except ValueError as error:  # a name that is none, a value that does not fit
            answer(False, str(error))
            return _Nothing()

    def _service_of(self, p: AxisParameters) -> tuple[Any, str]:
        """Return the type and the name of the service that takes a home."""
        if p.apply is Apply.relay:
            return SetParameters, f'{self._relay_of(p)}/set_parameters'
        return requests.service_type(p.apply_type), p.apply_service

    def _prepare(self, p: AxisParameters) -> str:
        """Make the client by which a home is applied; return why there can be none, else ''."""
        try:
            if p.apply is not Apply.none:
                self._clients.of(*self._service_of(p))
        except ValueError as error:
            return f'apply_service: {error}'
        return ''

    def _answer(self, handover: Handover, number: int, yes: bool, text: str) -> None:
        with self._lock:
            handover.answer(number, yes, text)

    def _shown(self, name: str, message: JointState) -> None:
        """Take a message of the relay."""
        joint = self._joints[name]
        if joint not in message.name:
            return
        stamp = message.header.stamp
        position = message.position[message.name.index(joint)]
        with self._lock:
            handover = self._axes[name].handover
            if handover is not None:
                handover.shown(position, stamp.sec + stamp.nanosec * 1e-9)

    def _relay_of(self, p: AxisParameters) -> str:
        return relay_of(self._node.get_fully_qualified_name(), p)

    def _due(self) -> bool:
        """Whether the managers are to be asked what their controllers are."""
        wanted = any(axis.parameters.switch_controllers for axis in self._axes.values())
        return wanted and time.monotonic() > self._asked + ASK_PERIOD

    def _ask_managers(self) -> bool:
        """Ask the managers now and then; return whether an answer is still to come."""
        if self._due():
            self._asked = time.monotonic()
            services = managers.services(self._node)
            for service in [one for one in self._managers if one not in services]:
                self._managers.pop(service).close()
                self._listed.pop(service.rpartition('/')[0], None)
            for service in services:
                if service in self._managers:
                    self._managers[service].ask()
                else:
                    self._managers[service] = ManagerList(
                        self._node, service, PATIENCE, self._clients
                    )
                    managers.prepare(self._clients, service.rpartition('/')[0])
        waiting = False
        for service, manager in self._managers.items():
            if manager.poll():
                self._listed[service.rpartition('/')[0]] = manager.controllers or {}
            else:
                waiting = True
        return waiting


def _request(
    kind: Any, p: AxisParameters, values: Mapping[str, float], axis: str, joint: str
) -> Any:
    fields = request_fields(p.apply_request, {**values, 'axis': axis, 'joint': joint})
    return requests.filled(kind.Request(), fields)


class _Nothing:
    """Asks nothing: the cycle sees by itself what is waited for, or the answer is there."""

    def poll(self) -> bool:
        return True

    def close(self) -> None:
        return


class _Calling:
    """Calls a service, and tells the hand-over what it answers."""

    def __init__(self, question: Question, answer: Callable[[bool, str], None]) -> None:
        self._question, self._answer, self._told = question, answer, False

    def poll(self) -> bool:
        if self._question.poll() and not self._told:
            self._told = True
            if self._question.answer is not None:  # else the bound of the step ends it
                self._answer(*requests.verdict(self._question.answer))
        return self._told

    def close(self) -> None:
        self._question.close()


class _Switching:
    """Switches controllers of one or several managers, and tells the hand-over when all are."""

    def __init__(self, switches: list[Switch], answer: Callable[[bool, str], None]) -> None:
        self._switches, self._answer, self._told = switches, answer, False

    def poll(self) -> bool:
        over = [one.poll() for one in self._switches]
        if all(over) and not self._told:
            self._told = True
            wrong = [one.answer for one in self._switches if one.answer]
            self._answer(not wrong, '; '.join(wrong))
        return self._told

    def close(self) -> None:
        for one in self._switches:
            one.close()


class _Looking:
    """Listens to the homed joints of the relay."""

    def __init__(self, node: Node, relay: str, take: Callable[[JointState], None]) -> None:
        self._node = node
        self._subscription = node.create_subscription(
            JointState, f'{relay}/joint_states', take, BEST_EFFORT
        )

    def poll(self) -> bool:
        return False

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)
