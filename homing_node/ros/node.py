# SPDX-License-Identifier: Apache-2.0
"""The homing node: topics, services and parameters around the axes.

Five threads, and a sixth with `layout`. The *cycle* (cycle.py) polls the inputs, updates the axes
and publishes setpoints on a fixed grid. The *executor* (the main thread) answers services and
parameters. The *reports* publish all that is not a setpoint. The *memory* and the *recorder* write
files. The *rehearsals* wait for processes of their own. ``_lock`` guards the axes; nothing is
published or waited for while it is held.
"""

import threading
import traceback
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from ..core.dispatch import Dispatch
from ..core.outcome import Outcome
from ..core.shared_signals import SharedSignals
from ..diagnosis import facts
from ..parameters.axis import AxisParameters
from ..parameters.configuration import home_sequence
from ..parameters.qos import POLICIES
from . import words
from .configured_node import ConfiguredNode
from .controllers import Controllers
from .cycle import Cycle, late_cycle
from .guarded_axis import GuardedAxis, GuardedGantry
from .handovers import Handovers
from .input_status import InputStatus
from .inputs import Inputs
from .jogging import Jogs
from .joint_order import JointOrder
from .latched import latched_publisher
from .locks import Permissions
from .markers import Markers
from .memory import Memories
from .outputs import Outputs
from .readiness import Readiness
from .recorder import recorder_of
from .rehearsals import Rehearsals
from .reports import Publishers, Reports, StateReport
from .services import Services
from .setpoints import INTERFACES, PositionSetpoints
from .subscriptions import Subscriptions
from .timebase import TimeBase
from .waits import Waits

OVERRIDABLE = QoSOverridingOptions([QoSPolicyKind[policy.upper()] for policy in POLICIES])


class HomingNode(ConfiguredNode):
    """Homes the axes that its parameters describe; doc/ros_interface.md is its contract.

    Raises InvalidParameters, with every fault, if the parameters are bad.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('homing_node', **kwargs)
        checked = self.configuration
        period = 1.0 / checked.update_rate
        self._joints = checked.joints
        self._axes = {name: self._make_axis(name, period) for name in checked.axes}
        self._drives = {
            name: drive for axis in self._axes.values() for name, drive in axis.drives.items()
        }
        self._lock = threading.Lock()
        simulated = bool(self.get_parameter('use_sim_time').value)
        self._timebase = TimeBase(self._ros_time if simulated else None)
        subscriptions = Subscriptions(self)
        self._inputs = Inputs(
            self._drives,
            self._joints,
            self._timebase,
            subscriptions,
            lambda late: late_cycle(late, self._cycle.timeout),
            self._lock,
            checked.serialized,
        )
        for name in self._drives:
            self._inputs.wire(name, checked.connections[name])
        self._shared_signals = SharedSignals(self._drives, self._inputs.wiring)
        self._note_wiring()
        self._setpoints = INTERFACES[checked.setpoint_interface](
            self._drives, checked, self._timebase, self._create_setpoints
        )
        self._inputs.serve_others(self._setpoints.others)
        self._handovers = Handovers(self, self._axes, self._joints, self._lock)
        self._controllers = Controllers(
            self,
            self._setpoint_publisher,
            self._describe_setpoints,
            self._any_run,
            self._lose,
            self._handovers.relays,
        )
        self._order = (
            JointOrder(self._setpoints.array.slots, period)
            if isinstance(self._setpoints, PositionSetpoints)
            else None
        )
        group = ReentrantCallbackGroup()
        self.permissions = Permissions(subscriptions, checked.coordinated)
        readiness = Readiness(
            lambda: self.faults,
            self._inputs,
            self._shared_signals,
            self._controllers,
            self._handovers,
            self._order,
            self._setpoints,
            self._timebase,
            self._publishers_of,
            self._any_run,
            self.permissions.refusal,
            lambda name: self._axes[name].drives if name in self._axes else (),
        )
        self._waits = Waits(self, group)
        self._dispatch: Dispatch[Future] = Dispatch(
            self._axes,
            checked.home_sequence,
            readiness.unready,
            self._waits.future,
            checked.ready_timeout,
        )
        self._memories = Memories(
            self,
            self._axes,
            checked.memory,
            self.topics_of,
            self._inputs.feedback_topic_of,
            self._lock,
            group,
        )
        self._rehearsals = Rehearsals(self, self._axes, self._memories.expected, self._lock)
        self._recorder = recorder_of(self, self._axes, self._timebase, self._lock)
        self._create_publishers()
        self._create_services(group)
        self._cycle = Cycle(
            self._axes,
            period,
            checked.cycle_timeout,
            self._timebase,
            self._lock,
            self._inputs,
            self._dispatch,
            self._setpoints,
            self._order,
            self._controllers,
            self._handovers,
            self._outputs,
            self._reports,
            self._waits,
            self._recorder,
            self.permissions,
            self.get_logger(),
        )
        self.serve_parameters()

    # ---------------------------------------------------------------------------------- creation

    def _make_axis(self, name: str, period: float) -> GuardedAxis:
        """Return an axis, or the gantry that it leads."""
        checked = self.configuration
        made = name, checked.axes[name], period, self._axis_broke, checked.lead
        followers = checked.followers.get(name)
        return GuardedGantry(*made, followers) if followers else GuardedAxis(*made)

    def _create_setpoints(self, kind: Any, topic: str) -> Any:
        """Create the publisher of a setpoint interface."""
        self._setpoint_publisher = self.create_publisher(
            kind, topic, 1, qos_overriding_options=OVERRIDABLE
        )
        return self._setpoint_publisher

    def _describe_setpoints(self) -> facts.Setpoints:
        """Return what the rules about controllers must know."""
        drives = self._drives.items()
        return facts.Setpoints(
            self._setpoint_publisher.topic_name,
            str(self.configuration.setpoint_interface),
            self.configuration.position_joints,
            {self._joints[name]: (name, drive.parameters) for name, drive in drives},
            self.configuration.update_rate,
        )

    def _any_run(self) -> bool:
        return any(axis.moving for axis in self._axes.values())

    def _lose(self, outcome: Outcome) -> None:
        """End every run: the controller that played the setpoints is gone, or another came."""
        with self._lock:
            for axis in self._axes.values():
                if axis.moving:
                    axis.stop(outcome.error, outcome.message)

    def _create_publishers(self) -> None:
        self._outputs = Outputs(self, self.configuration.connections, self._waits.call)

        publishers = Publishers(
            states={
                axis: latched_publisher(self, AxisState, f'~/{axis}/state') for axis in self._axes
            },
            outputs=self._outputs.sinks,
            joint_states=self.create_publisher(JointState, '~/joint_states', 10),
            diagnostics=self.create_publisher(DiagnosticArray, '/diagnostics', 1),
        )
        self._markers = Markers(
            latched_publisher(self, MarkerArray, '~/markers'),
            self._axes,
            self._joints,
            self.configuration.marker_frame,
            self._waits.call,
        )
        self._reports = Reports(
            self._axes,
            self._joints,
            publishers,
            self._ros_time,
            self._lock,
            self.get_fully_qualified_name(),
            self.get_logger(),
            InputStatus(lambda: self._shared_signals.wiring, self._timebase).of,
            self._note_state,
            1.0 / self.configuration.update_rate,
        )

    def _note_state(self, axis: GuardedAxis, stamp: int, report: StateReport) -> bool:
        """Record and show a state that is published; return whether it is recorded.

        The lock is held.
        """
        self._markers.state(axis, stamp)
        return self._recorder.state(axis, stamp, report)

    def _create_services(self, group: CallbackGroup) -> None:
        services = self.servers = Services(
            self._dispatch,
            self._reports,
            self._timebase,
            self._lock,
            self._inputs.poll,
            self._waits.pause,
            self._memories,
            self._rehearsals,
            self.get_logger(),
        )

        def serve(kind: Any, name: str, callback: Any) -> None:
            self.create_service(kind, name, callback, callback_group=group)

        for name, axis in self._axes.items():
            serve(Trigger, f'~/{name}/home', services.home([name], f'~/{name}/home'))
            serve(
                Trigger, f'~/{name}/verify', services.home([name], f'~/{name}/verify', verify=True)
            )
            serve(Trigger, f'~/{name}/accept_home', services.accept_home(axis))
            serve(Trigger, f'~/{name}/cancel', services.cancel([name]))
            serve(Trigger, f'~/{name}/continue', services.resume(axis))
            serve(SetBool, f'~/{name}/servo', services.servo(axis))
        serve(Trigger, '~/home', services.home(list(self._axes), '~/home'))
        serve(Trigger, '~/cancel', services.cancel(list(self._axes)))

        def cancel(goal: Any) -> CancelResponse:
            services.cancel_goal(goal)
            return CancelResponse.ACCEPT

        def act(name: str, execute: Any) -> ActionServer:
            return ActionServer(
                self,
                Home,
                name,
                execute,
                callback_group=group,
                handle_accepted_callback=services.accept,
                cancel_callback=cancel,
            )

        self._jogs = Jogs(
            self,
            self._axes,
            services,
            self._reports,
            self._timebase,
            self._lock,
            self._waits.pause,
            group,
        )
        self._actions = [
            act('~/home', services.execute),
            *(act(f'~/{name}/verify', services.verify(name)) for name in self._axes),
        ]

    def _ros_time(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _publishers_of(self, topic: str) -> list[str]:
        return sorted(
            f'{info.node_namespace.rstrip("/")}/{info.node_name}'
            for info in self.get_publishers_info_by_topic(topic)
        )

    # -------------------------------------------------------------------------------- parameters

    def in_use(self, axis: str) -> str:
        """Return who homes an axis, or will within a sequence; '' if nobody does."""
        with self._lock:
            refusal = self._dispatch.busy(axis)
        return '' if refusal is None else refusal.message

    def take_axis(self, axis: str, parameters: AxisParameters) -> None:
        """Give an axis new parameters, which it has at its next run."""
        with self._lock:
            followers = self.followers_of(axis, parameters)
            if followers:
                self._axes[axis].configure(parameters, followers)
            else:
                self._axes[axis].configure(parameters)
            self._memories.configure(axis, parameters)
            self._rehearsals.renew(axis)
            self._inputs.wire(axis, self.connections_of(axis))
            self._note_wiring()

    def _note_wiring(self) -> None:
        """Note which inputs read the same signal."""
        wiring = self._shared_signals.wiring = self._inputs.wiring
        for name, drive in self._drives.items():
            drive.readings.wire_in_series(wiring.in_series(name))

    def take(self, name: str, value: Any) -> None:
        """Take a new value of one of the node's own parameters."""
        if name == 'home_sequence':
            self._dispatch.groups = home_sequence(value, list(self._axes))
        elif name == 'cycle_timeout':
            self._cycle.timeout = float(value)
        elif name == 'ready_timeout':
            self._dispatch.ready_timeout = float(value)
        elif name == 'marker_frame':
            self._markers.frame = str(value)
            with self._lock:
                self._markers.show(self._ros_time())
        elif self._recorder.folder is not None and name == 'record_runs':
            self._recorder.folder.runs = int(value)
        elif self._recorder.folder is not None and name == 'record_failures':
            self._recorder.folder.failures = int(value)

    # ------------------------------------------------------------------------------------ threads

    def start(self) -> None:
        """Start the threads; the caller spins the executor."""
        folder = self._recorder.folder
        for line in words.ready(
            self.configuration,
            self._setpoint_publisher.topic_name,
            {name: self._inputs.sources(name) for name in self._axes},
            {name: self._inputs.feedback_topic_of(name) for name in self._axes},
            '' if folder is None else str(folder.path),
        ):
            self.get_logger().info(line)
        self._cycle.start()
        ended = self._cycle.finished.is_set
        self._writer = threading.Thread(target=self._memories.run, args=(ended,), name='memory')
        self._writer.start()
        self._recorder.start(ended)
        self._rehearsals.start(ended)

    def stop(self) -> None:
        """Stop every axis, answer every request, then finish."""
        self._cycle.stop()

    def cancel_all(self) -> None:
        """Stop every axis, and refuse those that wait for their turn."""
        with self._lock:
            self._dispatch.cancel(list(self._axes))

    @property
    def at_rest(self) -> bool:
        """Whether no axis homes or moves, and none waits for its turn."""
        with self._lock:
            return self._dispatch.idle and not any(axis.running for axis in self._axes.values())

    def forget_homes(self) -> None:
        """Forget the home of every axis."""
        with self._lock:
            for axis in self._axes.values():
                axis.forget_home()

    def join(self) -> None:
        """Wait for the threads."""
        self._cycle.join()
        self._writer.join()
        self._recorder.join()
        self._rehearsals.join()

    @property
    def finished(self) -> bool:
        """Whether every axis is at rest after `stop`, and every request has its answer."""
        return self._cycle.finished.is_set()

    @property
    def broken(self) -> bool:
        """Whether the node ends because a part of it broke."""
        return self._cycle.broken

    def _axis_broke(self, text: str, error: Exception) -> None:
        """Log why an axis has broken; it stops, and the others go on."""
        trace = ''.join(traceback.format_exception(error))
        self.get_logger().error(f'{text}\n{trace}')
