# SPDX-License-Identifier: Apache-2.0
"""The executable `simulated_axes`: the plant of plant/simulated_axis.py as a process of its own.

The homing node takes the time of an edge from the time stamp that the middleware gives the
message in publish(), so a message must be published when its event happens. Therefore the world
is computed ahead: what a setpoint causes begins `dead_time` after it arrived (the transport delay
of a drive), and every change of an input and every feedback sample waits in a queue until its own
time. One thread does all of it. When the process was held up, the world stands still for as long:
nothing is published late in a burst, and stamps keep fitting the positions.

What the spring between a follower of a gantry and its leader bears is told on
``~/<axis>/<follower>/racking_force`` (N), with each feedback sample.

No executor spins this node, so `ros2 param` cannot ask it; its services, and the
controller that can be switched, are nodes of a thread of their own (services.py).
"""

import gc
import os
import signal
import sys
import time
from array import array
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import inf
from operator import attrgetter
from typing import Any

import rclpy
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from ...plant.gantry import Plant, Side, plants
from ...plant.layout import AxisLayout
from ...procedures.states import Input
from ..graph import SETPOINT_TOPICS
from ..polling import Polled, Take, never_called, taker, waiting
from . import drivers
from .cell import Cell
from .controller import controller_for
from .outputs import Change, Lateness, Output, Sample
from .services import Services
from .settings import Settings, settings_from

#: How long before something is due the thread wakes up and waits for the exact time, s.
LEAD = 0.0001
#: How long before a change nothing else is begun that can wait, s. Publishing can take this long:
#: the reader that it wakes up may take the processor.
CLEAR = 0.001
#: Lateness of a change, and of feedback, from which on the world stands still for as long, s. The
#: former is half a feedback interval at 500 Hz: an edge then is never off by more than one.
HELD_UP = 0.001
STALL = 0.05

#: How long a driver that restarts is silent, s.
RESTART = 0.3

SERVO = Input.SERVO_ENABLED.value

RELIABLE = QoSProfile(depth=100)
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class SimulatedAxes:
    """The simulated world in real time."""

    def __init__(self, node: Node, settings: Settings) -> None:
        self._logger = node.get_logger()
        self._debug = self._logger.is_enabled_for(LoggingSeverity.DEBUG)
        self._axes = plants(settings.layouts)
        self._by_joint = dict(zip(settings.joints, self._axes.values(), strict=True))
        self._dt = 1.0 / settings.step_rate
        self._dead_time = settings.dead_time
        self._feedback_rate = settings.feedback_rate
        self._controller_rate = settings.controller_rate
        self._updates = 0  # of the controller
        self._count = 0  # of the samples computed
        self._samples: deque[Sample] = deque()
        self._changes: deque[Change] = deque()
        self._front = 0.0  # the world is computed up to this time of its own, s
        self._base = 0.0  # the monotonic time at which the world's time 0 is due, s
        self._to_system = 0  # what turns monotonic time into system time, ns
        self.lateness = Lateness()

        self._node = node
        self._silent = 0.0  # the feedback is silent up to this time, s
        self._joint_states = node.create_publisher(JointState, 'joint_states', RELIABLE)
        self._feedback = JointState(name=list(settings.joints))
        self._driver = drivers.FeedbackDriver(
            settings.feedback_read_rate, settings.header_clock_offset
        )
        self._second = (
            drivers.SecondSource(
                node, settings.joints, settings.second_source, settings.second_source_position
            )
            if settings.second_source
            else None
        )
        # Of each follower of a gantry: its side, and who tells what its spring bears.
        self._racked = [
            (side, node.create_publisher(Float64, f'~/{_path(name)}/racking_force', RELIABLE))
            for name, side in self._axes.items()
            if isinstance(side, Side) and name not in settings.layouts
        ]
        self._outputs: dict[tuple[str, str], Output] = {}
        self._inputs: list[tuple[Take, Callable[[Any], None]]] = []
        self._polled = Polled()
        for name, layout in settings.sides.items():
            self._connect(node, settings, name, layout)
        self._drivers = [o for o in self._outputs.values() if o.driver is not None]
        self._switches = deque(o for o in self._outputs.values() if o.level is not None)
        start = [axis.position for axis in self._axes.values()]
        controller, kind = controller_for(settings, start)
        self._cell = Cell(
            self._axes,
            settings.joints,
            controller,
            bool(settings.controller),
            lambda: self._sent_at(self._front),
            self._samples.clear,
            self._restart_feedback,
        )
        self._services = Services(node, list(self._axes), settings.joints, self._cell, settings)
        topic = f'{settings.target_node}/{SETPOINT_TOPICS[settings.setpoint_interface]}'
        if self._services.controller is not None:
            node, topic = self._services.controller, '~/joint_trajectory'
        self._subscribe(node, kind, topic, QoSProfile(depth=10), self._take)
        self._services.start()

    def close(self) -> None:
        """Destroy the other nodes of this process."""
        self._services.close()
        if self._second is not None:
            self._second.close()

    def _connect(self, node: Node, settings: Settings, name: str, layout: AxisLayout) -> None:
        """Create an axis's publishers and subscription, and publish the first levels."""
        axis, prefix = self._axes[name], f'{settings.target_node}/{_path(name)}'
        for key, level in {**axis.levels(), SERVO: axis.enabled}.items():
            polled = bool(layout.switch_rate) and key != SERVO
            publisher = node.create_publisher(
                Bool, f'{prefix}/{key}', RELIABLE if polled else LATCHED
            )
            output = Output(name, publisher, Bool(data=level))
            publisher.publish(output.level)
            self._outputs[name, key] = output
            if key != SERVO and (layout.switch_rate or settings.switch_heartbeat):
                output.driver = drivers.switch_driver(
                    f'{name}/{key}',
                    level,
                    layout.switch_rate or 0.0,
                    settings.switch_heartbeat,
                    settings.switch_jitter,
                )
        latches = {
            Input.Z_PULSE.value: layout.index_pitch > 0.0,
            Input.TOUCH_PROBE.value: layout.touch_probe is not None,
        }
        for key, fitted in latches.items():
            if fitted:
                publisher = node.create_publisher(Float64, f'{prefix}/{key}', RELIABLE)
                self._outputs[name, key] = Output(name, publisher)
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        joint = settings.joints[list(self._axes).index(name)]
        self._subscribe(
            node, Bool, f'{prefix}/servo_on', qos, lambda m: self._servo(axis, joint, m.data)
        )

    def _subscribe(
        self, node: Node, kind: Any, topic: str, qos: QoSProfile, take: Callable[[Any], None]
    ) -> None:
        """Subscribe to a topic that is polled at every step."""
        subscription = node.create_subscription(
            kind, topic, never_called, qos, callback_group=self._polled
        )
        self._inputs.append((taker(subscription, serialized=False), take))

    def run(self, stopped: Callable[[], bool]) -> None:
        """Let the world's time pass until `stopped()`."""
        self._compare_clocks()
        self._base = time.monotonic() + self._dead_time
        while not stopped():
            now = time.monotonic()
            change = self._base + self._changes[0].time if self._changes else inf
            sample = self._base + self._samples[0].time if self._samples else inf
            front = self._base + self._front
            turn = front - self._dead_time  # when to compute the next step
            if now - change > HELD_UP:
                self._stand_still(now - change)
            elif now - min(sample, front) > STALL:
                self._stand_still(now - min(sample, front))
            elif change - now <= LEAD:
                while time.monotonic() < change:
                    pass
                self._publish_change(self._changes.popleft(), change)
            elif sample <= now and (change - now > CLEAR or now - sample > CLEAR):
                self._publish_sample(self._samples.popleft(), sample)
            elif turn <= now and (change - now > CLEAR or turn <= now - CLEAR):
                self._step()
            else:
                time.sleep(min(t for t in (change - LEAD, sample, turn) if t > now) - now)

    def _stand_still(self, late: float) -> None:
        self._base += late
        self.lateness.hold_ups += 1
        self.lateness.held_up += late
        if late > STALL:
            self._logger.warning(f'held up for {late:.3f} s: the axes stood still meanwhile')

    def _compare_clocks(self) -> None:
        """Find what turns monotonic into system time, from the closest of a few readings."""
        readings = []
        for _ in range(3):
            before, system = time.monotonic_ns(), time.time_ns()
            after = time.monotonic_ns()
            readings.append((after - before, system - (before + after) // 2))
        self._to_system = min(readings)[1]

    def _publish_sample(self, sample: Sample, due: float) -> None:
        if due < self._silent:
            return
        stamp = self._feedback.header.stamp
        stamp.sec, stamp.nanosec = divmod(
            int(due * 1e9) + self._to_system + self._driver.offset, 1_000_000_000
        )
        self._feedback.position = sample.position
        self._feedback.velocity = sample.velocity
        self._joint_states.publish(self._feedback)
        for (_, publisher), force in zip(self._racked, sample.forces, strict=True):
            publisher.publish(Float64(data=force))

    def _publish_change(self, change: Change, due: float) -> None:
        late = time.monotonic() - due
        output, happening = change.output, change.happening
        output.publisher.publish(change.message)
        self.lateness.happenings += 1
        self.lateness.worst = max(self.lateness.worst, late)
        if isinstance(change.message, Bool):
            output.level = change.message
        if self._debug and happening is not None:
            self._logger.debug(
                f'{output.axis}: {happening.input} {happening.value} '
                f'at {happening.position:.9f}, published {late * 1e6:.0f} µs late'
            )

    def _step(self) -> None:
        """Take what has arrived, and compute the world's next step."""
        for next_message, take in self._inputs:
            for message, _ in waiting(next_message):
                take(message)
        self._services.jobs.run()
        self._control()
        start, dt = self._front, self._dt
        before = [axis.position for axis in self._axes.values()]
        changes = []
        levels: dict[int, list[tuple[float, bool]]] = {}  # of switches whose driver repeats them
        for name, axis in self._axes.items():
            for happening in axis.step(dt):
                value = happening.value
                message = (
                    Bool(data=value)
                    if isinstance(value, bool)
                    else Float64(data=value - self._cell.offsets[name])
                )
                output = self._outputs[name, happening.input]
                if output.driver is None:
                    changes.append(Change(happening.time, output, message, happening))
                else:
                    levels.setdefault(id(output), []).append((happening.time, bool(value)))
            self._front = axis.time
            if self._outputs[name, SERVO].publish(axis.enabled) and axis.timed_out:
                self._logger.warning(
                    f'{name}: no setpoint came after {axis.told:.6f}: '
                    'the drive stops by itself, until its servo is switched off and on'
                )
        for output in self._drivers:
            told = levels.get(id(output), ())
            if output.driver is not None and (told or output.driver.due <= self._front):
                for moment, level in output.driver.step(self._front, told):
                    changes.append(Change(moment, output, Bool(data=level), None))
        if changes:
            self._changes.extend(sorted(changes, key=attrgetter('time')))
        while (sampled := self._count / self._feedback_rate) <= self._front:
            part = (sampled - start) / dt
            moved = [a.position - b for a, b in zip(self._axes.values(), before, strict=True)]
            offsets = self._cell.offsets.values()
            position = array(
                'd', [b + m * part - o for b, m, o in zip(before, moved, offsets, strict=True)]
            )
            velocity = array('d', [m / dt for m in moved])
            reading = self._driver.reading(sampled, position, velocity)
            forces = [side.force for side, _ in self._racked]
            self._samples.append(Sample(sampled, *reading, forces))
            self._count += 1
        if self._switches:  # one at a time, so that no step takes long
            self._switches.rotate(1)
            self._switches[0].greet()
        if self._second is not None:
            self._second.step(self._front, self._sent_at(self._front))
        if self._count % 500 == 0:
            self._compare_clocks()

    def _control(self) -> None:
        """Let the controller update at its rate; its commands act after the dead time."""
        while (turn := self._updates / self._controller_rate) <= self._front + 1e-9:
            self._updates += 1
            self._cell.control(self._sent_at(turn))

    def _sent_at(self, time: float) -> int:
        """Return the system time at which a command left that acts at a time of the world, ns."""
        return int((self._base + time - self._dead_time) * 1e9) + self._to_system

    def _restart_feedback(self) -> None:
        """Let a new publisher send the feedback, after a silence."""
        self._samples.clear()
        self._silent = time.monotonic() + RESTART
        self._node.destroy_publisher(self._joint_states)
        self._joint_states = self._node.create_publisher(JointState, 'joint_states', RELIABLE)

    def _servo(self, axis: Plant, joint: str, on: bool) -> None:
        """Switch a servo; one that comes on obeys at once what its controller commands."""
        off = not axis.enabled
        axis.servo(on)
        if on and off:
            self._cell.repeat(joint)

    def _take(self, message: Any) -> None:
        refused = self._cell.play(message)
        if refused:
            self._logger.warning(
                f'setpoint ignored: {refused}; the joints here are {list(self._by_joint)}',
                throttle_duration_sec=1.0,
            )


def _path(name: str) -> str:
    """Return the part of topics for an axis, or for a follower by its full name."""
    return name.replace('.', '/')


def main(args: list[str] | None = None) -> int:
    """Run the plant until SIGINT or SIGTERM; return the exit status."""
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy has no common base: bad arguments, a bad YAML file
        print(f'simulated_axes: {error}', file=sys.stderr)
        return 1
    node = rclpy.create_node(
        'simulated_axes',
        automatically_declare_parameters_from_overrides=True,
        start_parameter_services=False,
        parameter_overrides=[Parameter('start_type_description_service', value=False)],
    )
    try:
        parameters = node.get_parameters_by_prefix('')
        settings = settings_from({name: p.value for name, p in parameters.items()})
    except ValueError as error:
        for fault in str(error).splitlines():
            print(f'simulated_axes: {fault}', file=sys.stderr)
        return 1
    else:
        plant = SimulatedAxes(node, settings)
        gc.collect()
        gc.freeze()  # what lives as long as the process need not be searched in every collection
        with suppress(OSError):  # for those who may; others are held up now and then
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        plant.run(lambda: bool(signals))
        plant.close()
        lateness = plant.lateness
        node.get_logger().info(
            f'{lateness.happenings} happenings, the worst published {lateness.worst * 1e6:.0f} µs '
            f'late; held up {lateness.hold_ups} times, {lateness.held_up:.3f} s in all'
        )
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
