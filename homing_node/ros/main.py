# SPDX-License-Identifier: Apache-2.0
"""The process of the homing node: its start, its executor, its end."""

import gc
import os
import signal
import sys
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from .managed_node import ManagedNode
from .middleware import shared_memory_hazard
from .process import made

#: Longest wait for the last answers to leave after the axes have stopped, s.
FAREWELL = 1.0
#: The executor goes on for this long after the last answer: rclpy sends the result of an action
#: a few callbacks later, s.
LAST_RESULT = 0.05


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


def _send_last_answers(node: ManagedNode, executor: SingleThreadedExecutor) -> None:
    """Let the executor answer the requests that have ended with the node."""
    begun = last = time.monotonic()
    while (now := time.monotonic()) < min(last + LAST_RESULT, begun + FAREWELL):
        executor.spin_once(timeout_sec=0.01)
        if node.servers.open:
            last = now


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit status."""
    signaled = _signal_pipe()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl cannot read a parameter file
        hint = " (YAML reads an unquoted y or n as a boolean: axes: ['x', 'y'])"
        print(f'homing_node: {error}{hint if "bool" in str(error) else ""}', file=sys.stderr)
        return 1
    node = made('homing_node', ManagedNode)
    if node is None:
        return 1
    hazard = shared_memory_hazard(os.environ, rclpy.get_rmw_implementation_identifier())
    if hazard:
        node.get_logger().warning(hazard)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    gc.freeze()  # what is there now stays: a full collection need not look at it (15 ms)
    node.start()

    def wait_for_signal() -> None:
        os.read(signaled, 1)
        node.stop()

    threading.Thread(target=wait_for_signal, daemon=True).start()
    while not node.finished:
        try:
            executor.spin_once()
        except Exception as error:  # of one callback: the axes and the other clients go on
            node.get_logger().error(f'a callback broke: {error!r}')
    _send_last_answers(node, executor)
    node.join()
    gc.unfreeze()
    executor.shutdown(FAREWELL)  # its guards must go before their context
    node.destroy_node()
    rclpy.shutdown()
    return int(node.broken)
