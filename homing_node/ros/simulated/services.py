# SPDX-License-Identifier: Apache-2.0
"""The services of the simulated axes, and of a controller manager above them.

A drive can be told where its axis is; the driver can restart; the controller can be switched. The
services run in a thread with an executor of their own. What they change is done by the plant,
between two of its steps: each request is a job that the plant takes from a queue. How long an
answer takes, and what goes wrong with it, are parameters, so that a hand-over can be tried.
"""

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

from homing_interfaces.srv import SetPosition
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from ...parameters.definition import Definition
from ...procedures.states import TextEnum
from .action import Goals

try:
    from controller_manager_msgs.msg import ControllerState
    from controller_manager_msgs.srv import ListControllers, SwitchController
except ImportError:
    ControllerState = ListControllers = SwitchController = None

#: Longest wait for the plant to do a job, s.
PATIENCE = 5.0
KIND = 'joint_trajectory_controller/JointTrajectoryController'
#: What the node of the controller has as parameters besides its joints.
PARAMETERS: Mapping[str, Any] = {
    'command_interfaces': ['position'],
    'state_interfaces': ['position'],
    'allow_partial_joints_goal': True,
    'interpolate_from_desired_state': True,
    'allow_nonzero_velocity_at_trajectory_end': False,
}


class Answer(TextEnum):
    """How a service answers: as it should, not at all, with a refusal, or with a lie."""

    good = 'good'
    never = 'never'
    no = 'no'
    lie = 'lie'


#: The parameters of the services.
DEFINITIONS: Sequence[Definition] = (
    Definition(
        'the controller that plays the setpoints on <controller>/joint_trajectory, and that '
        'controller_manager switches (empty: none, the topic of target_node is played)',
        str,
        name='controller',
        default='',
    ),
    Definition(
        'how long a service takes to answer',
        float,
        's',
        0.0,
        60.0,
        name='answer_time',
        default=0.0,
    ),
    Definition(
        'how set_position answers; lie: yes, but the drive does nothing',
        Answer,
        name='set_position_answer',
        default=Answer.good,
    ),
    Definition(
        'how switch_controller answers when it activates; lie: yes, but the controller stays off',
        Answer,
        name='activate_answer',
        default=Answer.good,
    ),
)


class Plant(Protocol):
    """What the services change; called between two steps of the plant, except `active`."""

    active: bool

    def set_position(self, axis: str, position: float) -> str:
        """Change the coordinates of a drive; return why not, '' if it is done."""

    def restart(self) -> str:
        """Restart the driver: its coordinates are the encoder's again."""

    def switch(self, on: bool) -> str:
        """Activate or deactivate the controller."""


class Jobs:
    """Jobs from the thread of the services to the thread of the plant."""

    def __init__(self) -> None:
        self._jobs: deque[Callable[[], None]] = deque()

    def run(self) -> None:
        """Do all jobs that wait; the plant calls it."""
        while self._jobs:
            self._jobs.popleft()()

    def do(self, job: Callable[[], str]) -> str:
        """Have a job done; return what it returns."""
        done, found = threading.Event(), []

        def run() -> None:
            found.append(job())
            done.set()

        self._jobs.append(run)
        return found[0] if done.wait(PATIENCE) else 'the simulated axes do not answer'


class Services:
    """The nodes of the services, and the thread that spins them."""

    def __init__(
        self,
        plant_node: Node,
        axes: Sequence[str],
        joints: Sequence[str],
        plant: Plant,
        settings: Any,
    ) -> None:
        """Create the nodes and start the thread.

        Args:
            plant_node: The node of the simulated axes.
            axes: The names of the axes.
            joints: Their joints.
            plant: What the services change.
            settings: The parameters: `answer_time`, `set_position_answer`, `activate_answer`,
                `controller`.
        """
        self.jobs = Jobs()
        self._closing = threading.Event()
        self._plant, self._joints = plant, list(joints)
        self._name = settings.controller
        namespace, own = plant_node.get_namespace(), plant_node.get_fully_qualified_name()

        def node(name: str, **options: Any) -> Node:
            return Node(name, namespace=namespace, use_global_arguments=False, **options)

        self._drives = drives = node(f'{plant_node.get_name()}_drives')
        for name in ('answer_time', 'set_position_answer', 'activate_answer'):
            value = getattr(settings, name)
            drives.declare_parameter(name, str(value) if isinstance(value, Answer) else value)
        drives.add_on_set_parameters_callback(_check)
        for axis in axes:
            drives.create_service(
                SetPosition,
                f'{own}/{axis.replace(".", "/")}/set_position',
                partial(self._set_position, axis),
            )
        drives.create_service(Trigger, f'{own}/restart', self._restart)
        self._nodes = [drives]
        self.controller: Node | None = None
        if self._name:
            self.controller = node(self._name)
            for parameter, value in {'joints': self._joints, **PARAMETERS}.items():
                self.controller.declare_parameter(parameter, value)
            self._nodes.append(self.controller)
            if ListControllers is not None:
                manager = node('controller_manager')
                manager.create_service(ListControllers, '~/list_controllers', self._list)
                manager.create_service(SwitchController, '~/switch_controller', self._switch)
                self._nodes.append(manager)
        self.goals = Goals(self.controller, self.jobs, plant) if self.controller else None
        self._executor = SingleThreadedExecutor()
        for one in self._nodes:
            self._executor.add_node(one)
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def close(self) -> None:
        """Answer no more."""
        self._closing.set()
        self._executor.shutdown(timeout_sec=PATIENCE)
        self._thread.join(PATIENCE)
        for one in self._nodes:
            one.destroy_node()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _answer(self, name: str) -> Answer:
        """Let an answer take its time; return how a service answers."""
        answer = Answer(self._drives.get_parameter(name).value) if name else Answer.good
        self._closing.wait(self._drives.get_parameter('answer_time').value)
        if answer is not Answer.never:
            return answer
        self._closing.wait(PATIENCE)
        return Answer.no

    def _set_position(
        self, axis: str, request: SetPosition.Request, response: SetPosition.Response
    ) -> SetPosition.Response:
        answer = self._answer('set_position_answer')
        response.message = 'refused'
        if answer is Answer.good:
            position = float(request.position)
            response.message = self.jobs.do(partial(self._plant.set_position, axis, position))
        elif answer is Answer.lie:
            response.message = ''
        response.success = not response.message
        return response

    def _restart(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = self.jobs.do(self._plant.restart)
        response.success = not response.message
        return response

    def _list(self, _: Any, response: Any) -> Any:
        active = self._plant.active
        response.controller = [
            ControllerState(
                name=self._name,
                state='active' if active else 'inactive',
                type=KIND,
                claimed_interfaces=[f'{joint}/position' for joint in self._joints if active],
            )
        ]
        return response

    def _switch(self, request: Any, response: Any) -> Any:
        on, off = (
            list(names) for names in (request.activate_controllers, request.deactivate_controllers)
        )
        unknown = [name for name in [*on, *off] if name != self._name]
        answer = self._answer('activate_answer' if on else '')
        response.message = ''
        if unknown:
            response.message = f'no controller {", ".join(unknown)}'
        elif answer is Answer.no:
            response.message = f'{self._name} does not activate'
        elif answer is Answer.good:
            response.message = self.jobs.do(partial(self._plant.switch, bool(on)))
        response.ok = not response.message
        return response


def _check(parameters: list[Parameter]) -> SetParametersResult:
    """Check new values: how the services answer can be set while they run."""
    known = {one.name: one for one in DEFINITIONS}
    try:
        for parameter in parameters:
            if parameter.name in known:
                known[parameter.name].convert(parameter.value)
    except ValueError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
