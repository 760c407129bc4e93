# SPDX-License-Identifier: Apache-2.0
"""The process of the homing node: its start, its executor, its end.

Python's collector rests until all is there: a start leaves next to no garbage, and looking for
some took a tenth of it. The rest of the package is imported while the middleware finds the others.
"""

import gc

gc.disable()

import os
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from ..parameters.definition import InvalidParameters
from .transport import choose_udp

if TYPE_CHECKING:
    from .node import HomingNode

#: How long the last answers may take to leave after the axes have stopped, s.
FAREWELL = 1.0


def _signal_pipe() -> int:
    """Return a file descriptor that becomes readable at SIGINT or SIGTERM.

    A handler alone would run only once the main thread leaves rcl's wait.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    return reader


def _create_node() -> 'HomingNode':
    """Return the homing node; raises InvalidParameters.

    The middleware begins to look for others with the first node of a process and has found them
    0.1 to 0.3 s later. So a hidden one comes first, and ours is imported meanwhile. Unlike rclpy's
    own nodes it has no publisher and no service: others could miss ours because those were gone.
    """
    context = rclpy.get_default_context().handle
    with context:
        scout = rclpy_implementation.Node('_homing_node', '/', context, None, False, False)
    try:
        from .node import HomingNode

        return HomingNode()
    finally:
        scout.destroy_when_not_in_use()


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit status."""
    signaled = _signal_pipe()
    choose_udp(os.environ, rclpy.get_rmw_implementation_identifier())
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl cannot read a parameter file
        hint = " (YAML reads an unquoted y or n as a boolean: axes: ['x', 'y'])"
        print(f'homing_node: {error}{hint if "bool" in str(error) else ""}', file=sys.stderr)
        return 1
    try:
        node = _create_node()
    except InvalidParameters as error:
        print(
            'homing_node: the parameters are not valid:',
            *error.faults,
            sep='\n  ',
            file=sys.stderr,
        )
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    gc.freeze()  # what is there now stays: a full collection need not look at it (15 ms)
    gc.enable()
    node.start()

    def wait_for_signal() -> None:
        os.read(signaled, 1)
        node.stop()

    threading.Thread(target=wait_for_signal, daemon=True).start()
    while not node.finished.is_set():
        try:
            executor.spin_once()
        except Exception as error:  # of one callback: the axes and the other clients go on
            node.get_logger().error(f'a callback broke: {error!r}')
    until = time.monotonic() + FAREWELL
    while executor._tasks and time.monotonic() < until:
        executor.spin_once(timeout_sec=0.01)
    node.join()
    gc.unfreeze()
    node.destroy_node()
    rclpy.shutdown()
    return int(node.broken)
