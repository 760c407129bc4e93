# SPDX-License-Identifier: Apache-2.0
"""The executable `homed_axes`: the machine in homed coordinates.

It stands between the world and the controllers: `~/joint_states` for the world, and motions of the
world for the controllers, shifted by the home of each axis. It knows a home from the homing node,
and goes on when that one restarts; it moves no axis whose home is not known (relay/known_home.py).
"""

import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from homing_interfaces.msg import AxisState
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile

from ...procedures.states import Apply, Error, State
from ...relay.known_home import KnownHome
from .. import graph, messages, process
from .joint_states import JointStateThread
from .motion import INSTALLED, ControllerRelay
from .settings import HOME, home_of, settings_from

#: How often the age of the feedback and the goals are looked at, and the graph, s.
WATCH_PERIOD, GRAPH_PERIOD = 0.05, 1.0
#: How long the executor may keep the interpreter while the thread of the joint states wants it, s:
#: Python's own 5 ms would be the latency of a message now and then.
SWITCH_INTERVAL = 0.0002
#: Longest wait for the controllers to end the goals when the relay ends, s.
FAREWELL = 1.0
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class HomedAxes(Node):
    """The relay. Raises InvalidParameters, with every fault, if the parameters are bad."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'homed_axes', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        given = {name: p.value for name, p in self.get_parameters_by_prefix('').items()}
        settings = settings_from(given)
        self._lock = threading.Lock()
        self._axes = {
            name: KnownHome(name, p)
            for name, p in settings.axes.items()
            if p.apply is not Apply.none
        }
        simulated = bool(self.get_parameter('use_sim_time').value)
        self._now: Callable[[], float] = self._ros_time if simulated else time.monotonic
        for name in self._axes:
            self._declare_home(name)
        homing_node = graph.expand(settings.homing_node, self.get_fully_qualified_name())
        for name in self._axes:
            self.create_subscription(
                AxisState, f'{homing_node}/{name}/state', partial(self._take_state, name), LATCHED
            )
        self._states = JointStateThread(
            self, list(self._axes.values()), self._lock, self._now, self._lost
        )
        by_joint = {axis.joint: axis for axis in self._axes.values()}
        alone = len(settings.controllers) == 1
        self._controllers = [
            ControllerRelay(
                self,
                controller,
                [f'~/{controller.rpartition("/")[2]}', *(['~'] if alone else [])],
                by_joint,
                homing_node,
                self._guarded,
            )
            for controller in settings.controllers
        ]
        for name, offset in settings.homes.items():
            if name in self._axes:
                self._axes[name].told(offset)
        self.add_on_set_parameters_callback(self._check)
        self.add_post_set_parameters_callback(self._apply)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCH_PERIOD, self._watch, clock=steady)
        self.create_timer(GRAPH_PERIOD, self._states.watch, clock=steady)
        if not self._axes:
            self.get_logger().warning(
                'no axis has apply: relay or service; every motion is relayed as it is'
            )
        if not INSTALLED:
            self.get_logger().warning(
                'the package control_msgs is not installed: the topic joint_trajectory is '
                'relayed, the action follow_joint_trajectory is not served'
            )

    def start(self) -> None:
        """Begin to publish joint states."""
        self._states.start()

    def stop(self) -> bool:
        """Give up every goal; return whether one is still there."""
        left = [one.stop('the relay ends') for one in self._controllers]
        return any(left)

    def close(self) -> None:
        """End the thread."""
        self._states.close()

    # ------------------------------------------------------------------------------------- inside

    def _ros_time(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _guarded(self, call: Callable[[], Any]) -> Any:
        with self._lock:
            return call()

    def _declare_home(self, axis: str) -> None:
        """Declare the home of an axis, which may have no value."""
        name = f'{axis}.{HOME.name}'
        value = self.get_parameter(name).value if self.has_parameter(name) else None
        if self.has_parameter(name):
            self.undeclare_parameter(name)
        described: ParameterDescriptor = messages.descriptor(HOME)
        self.declare_parameter(name, value, described, ignore_override=True)

    def _take_state(self, name: str, state: AxisState) -> None:
        """Take what the homing node says of an axis, and show its home as a parameter."""
        axis = self._axes[name]
        error = '' if state.error == Error.NoError else state.error
        idle = state.state == State.Idle
        with self._lock:
            before = axis.refusal
            axis.said(state.homed, idle, error, state.message, state.home_offset)
            after, offset = axis.refusal, axis.offset
        if before != after:
            log = self.get_logger()
            log.info(after or f'axis {name} is homed: home_offset {offset:.9g}')
            if after:
                self._watch()
        parameter = f'{name}.{HOME.name}'
        if not after and self.get_parameter(parameter).value != offset:
            self.set_parameters([Parameter(parameter, value=offset)])

    def _lost(self) -> None:
        """Let the executor give up the goals of an axis that has lost its home."""
        if self.executor is not None:
            self.executor.create_task(self._watch)

    def _watch(self) -> None:
        now = self._now()
        with self._lock:
            before = [axis.refusal for axis in self._axes.values()]
            for axis in self._axes.values():
                axis.check_age(now)
            after = [axis.refusal for axis in self._axes.values()]
        for old, new in zip(before, after, strict=True):
            if new and old != new:
                self.get_logger().warning(new)
        for controller in self._controllers:
            controller.watch()

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Check the homes; all else takes effect at the start only."""
        faults = []
        for parameter in parameters:
            axis, _, name = parameter.name.partition('.')
            if axis not in self._axes or name != HOME.name:
                faults.append(f'{parameter.name}: takes effect at the start only')
                continue
            try:
                home_of(axis, parameter.value)
            except ValueError as error:
                faults.append(str(error))
        return SetParametersResult(successful=not faults, reason='; '.join(faults))

    def _apply(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            axis = self._axes[parameter.name.partition('.')[0]]
            with self._lock:
                axis.told(float(parameter.value))


def _end(node: HomedAxes, work: Callable[[], None]) -> None:
    """Give the goals up, and wait for the controllers to end them."""
    end = time.monotonic() + FAREWELL
    while node.stop() and time.monotonic() < end:
        work()


def main(args: list[str] | None = None) -> int:
    """Run the relay until SIGINT or SIGTERM; return the exit status."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    return process.run('homed_axes', HomedAxes, args, _end)
