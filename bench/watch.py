# SPDX-License-Identifier: Apache-2.0
"""Watching: what `homing watch` takes of a core, and whether the node's cycle is later for it.

32 axes with 200 inputs, of which one of each axis changes ten times a second, so that each axis
tells its state at 10 Hz. A stand-in publishes; the table is on a terminal of 200 columns.

Lateness is that of a real node all whose axes search: from when a cycle was due to the stamp that
the middleware gave its setpoints. The verb runs in every second block of one run of the node.
"""

import os
import pty
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from statistics import median
from typing import NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from figures import Figure, nth
from graph import Heard, World, cpu_seconds, free_domain
from grid import load
from homing_interfaces.msg import AxisState
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile

AXES, INPUTS, RATE = 32, 200, 10.0
#: Axes, and rate of the cycle and of the feedback, Hz, of the node whose lateness is measured.
CASES = ((8, 250.0), (32, 100.0))
SETTLE = 1.0  # s, before a block
NODE = '/homing_node'
#: The executable that a user runs.
EXECUTABLE = Path(sys.executable).with_name('homing')
GOAL = 0.15
NAMES = (
    'home_switch',
    'positive_limit_switch',
    'negative_limit_switch',
    'near_positive_limit_switch',
    'near_negative_limit_switch',
    'external_positive_limit_switch',
    'external_negative_limit_switch',
)


class StandIn:
    """Publishes what a node with many axes publishes, in a thread."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node('homing_node', context=self._context, enable_rosout=False)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._states = {
            f'a{i:02}': self._node.create_publisher(AxisState, f'~/a{i:02}/state', latched)
            for i in range(AXES)
        }
        self._inputs = {
            axis: NAMES[: INPUTS // AXES + (i < INPUTS % AXES)]
            for i, axis in enumerate(self._states)
        }
        self._diagnostics = self._node.create_publisher(DiagnosticArray, '/diagnostics', 1)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _publish(self) -> None:
        turn = 0
        while not self._ended.wait(1.0 / RATE):
            turn += 1
            for axis, inputs in self._inputs.items():
                levels = [(turn + i) % 2 if i == 0 else 0 for i in range(len(inputs))]
                state = AxisState(axis=axis, state='HSSearch', error='NoError')
                state.position, state.inputs, state.levels = 1e-3 * turn, list(inputs), levels
                self._states[axis].publish(state)
            if turn % RATE == 0:
                self._diagnostics.publish(DiagnosticArray(status=self._statuses()))

    def _statuses(self) -> list[DiagnosticStatus]:
        return [
            DiagnosticStatus(
                name=f'{NODE}: {axis}',
                values=[
                    KeyValue(key=name, value=f'off, 0.020 s, 50 Hz, {NODE}/{axis}/{name}')
                    for name in inputs
                ],
            )
            for axis, inputs in self._inputs.items()
        ]


@contextmanager
def watching(domain: int, lines: int, last: bytes) -> Iterator['subprocess.Popen[bytes]']:
    """Run the verb on a terminal of so many lines; it shows the axis ``last`` when this yields."""
    lead, follow = pty.openpty()
    size = {'COLUMNS': '200', 'LINES': str(lines), 'TERM': 'xterm-256color'}
    watch = subprocess.Popen(
        [EXECUTABLE, 'watch'],
        stdout=follow,
        env={**os.environ, **size, 'ROS_DOMAIN_ID': str(domain)},
    )
    os.close(follow)
    written: list[bytes] = []

    def read() -> None:
        try:
            while part := os.read(lead, 65536):
                written.append(part)
        except OSError:
            pass

    reader = threading.Thread(target=read)
    reader.start()
    try:
        while last not in b''.join(written):
            time.sleep(0.1)
        yield watch
    finally:
        watch.terminate()
        watch.wait()
        reader.join()
        os.close(lead)


def share(domain: int, lines: int, lasts: float) -> float:
    """Return which part of a core the verb takes on a terminal of so many lines."""
    with watching(domain, lines, b'a31') as watch:
        begin, before = time.monotonic(), cpu_seconds(watch.pid)
        time.sleep(lasts)
        return (cpu_seconds(watch.pid) - before) / (time.monotonic() - begin)


class Block(NamedTuple):
    """What was seen of the node in one block: its setpoints, and its share of a core, %."""

    heard: list[Heard]
    share: float


def blocks(
    axes: int, rate: float, lasts: float, times: int
) -> tuple[list[Block], list[Block], list[float]]:
    """Run a node all whose axes search, and watch it in every second block.

    Returns:
        The blocks with the watcher, those without, and when each setpoint was due.
    """
    world = World(axes, rate)
    found: tuple[list[Block], list[Block]] = [], []
    grid = world.folder / 'grid'
    try:
        with world.homing_node(rate, grid) as node:
            world.start_homing()
            for _ in range(times):
                for kind, watched in zip(found, (True, False), strict=True):
                    last = world.names[-1].encode()
                    with watching(world.domain, 60, last) if watched else nullcontext():
                        world.listen(SETTLE)
                        before = cpu_seconds(node.pid)
                        heard = world.listen(lasts)
                        used = cpu_seconds(node.pid) - before
                    kind.append(Block(heard, 100.0 * used / lasts))
    finally:
        world.close()
    return *found, load(grid)


def with_and_without(axes: int, rate: float, lasts: float, times: int) -> Iterator[Figure]:
    """Yield what the node takes and how late its cycle is, watched and not."""
    *kinds, due = blocks(axes, rate, lasts, times)
    case = f'{axes} axes, {rate:g} Hz, watched (bare: not watched)'
    yield Figure(f'{case}: node', '% of a core', *([one.share for one in kind] for kind in kinds))
    late = [
        [[(one.sent - due[one.number]) * 1e6 for one in block.heard] for block in kind]
        for kind in kinds
    ]
    for name, part in ('p50', 0.5), ('p99', 0.99):
        yield Figure(
            f'{case}: lateness {name}',
            'µs',
            *([nth(block, part) for block in kind] for kind in late),
        )


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the share of a core, for a terminal with a line for each input, and a usual one."""
    domain, lock = free_domain()
    stand_in = StandIn(domain)
    try:
        for lines in (300, 60):
            shares = [
                share(domain, lines, 2.0 if quick else 10.0) for _ in range(1 if quick else 5)
            ]
            yield Figure(
                f'{AXES} axes, {INPUTS} inputs at {RATE:g} Hz, {lines} lines',
                'of a core',
                shares,
                goal=f'< {GOAL:g}',
                met=median(shares) < GOAL,
            )
    finally:
        stand_in.close()
        lock.close()
    for axes, rate in CASES[:1] if quick else CASES:
        yield from with_and_without(axes, rate, *((1.0, 1) if quick else (4.0, 6)))
