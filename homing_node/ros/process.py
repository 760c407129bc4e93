# SPDX-License-Identifier: Apache-2.0
"""The process of a node: how it is made, and the life of one that stands above the homing node."""

import gc
import signal
import sys
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from ..parameters.definition import InvalidParameters

Made = TypeVar('Made')


class Running(Protocol):
    """A node that is started, and closed when all is said."""

    def start(self) -> None: ...
    def close(self) -> None: ...
    def destroy_node(self) -> None: ...


def made(name: str, make: Callable[[], Made]) -> Made | None:
    """Make a node; return None, with every fault on stderr, if its parameters are not valid.

    A half-made node that outlived the interpreter would crash it: the threads of the middleware
    still run (seen on Kilted).

    Args:
        name: What stands before the faults.
        make: Makes the node; raises InvalidParameters, with every fault.
    """
    try:
        return make()
    except InvalidParameters as error:
        print(f'{name}: the parameters are not valid:', *error.faults, sep='\n  ', file=sys.stderr)
    gc.collect()  # now that nothing refers to it, the half-made node goes before its context
    rclpy.shutdown()
    return None


def run(
    name: str,
    make: Callable[[], Any],
    args: list[str] | None,
    end: Callable[[Any, Callable[[], None]], None],
) -> int:
    """Run a node until SIGINT or SIGTERM; return the exit status.

    Args:
        name: What stands before the messages.
        make: Makes the node; raises InvalidParameters, with every fault.
        args: The arguments of the command line, None for those of this process.
        end: Ends what the node does; gets the node, and what lets its executor work for 10 ms.
    """
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl cannot read a parameter file
        print(f'{name}: {error}', file=sys.stderr)
        return 1
    node: Running | None = made(name, make)
    if node is None:
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    node.start()
    while not signals:
        executor.spin_once(timeout_sec=0.1)
    end(node, lambda: executor.spin_once(timeout_sec=0.01))
    node.close()
    executor.shutdown(1.0)
    node.destroy_node()
    rclpy.shutdown()
    return 0
