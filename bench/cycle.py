# SPDX-License-Identifier: Apache-2.0
"""Cycle of the node while all its axes home: processor time and lateness.

The counterpart is an rclpy loop in a thread of its own that publishes the same message, and, where
that is said, also takes the same inputs. Processor time is measured of all at once, second by
second, for a shared machine is faster in one second than in the next. Lateness is measured of one
after the other: from when a cycle was due to the stamp that the middleware gave its setpoints.
"""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from figures import Figure, alternately, nth, within
from graph import World, cpu_seconds
from grid import load

#: Rates of the cycle and of the feedback, Hz, and numbers of axes.
CASES = tuple(
    (rate, fed, axes) for rate, fed in ((250.0, 500.0), (1000.0, 1000.0)) for axes in (1, 8, 32)
)
#: Largest processor time against the bare loop, by rate and number of axes.
GOALS = {(250.0, 1): 1.6, (250.0, 8): 2.2}
NODE, BARE, TAKING = 'homing_node', 'bare', 'bare that takes the inputs'
WARM_UP = 1.0  # s


class Lateness(NamedTuple):
    """Lateness in µs (below 0: early), and how many cycles were left out."""

    p1: float
    p50: float
    p99: float
    max: float
    left_out: float


def running(world: World, what: str, rate: float) -> AbstractContextManager[Any]:
    """Run one of the three in a world."""
    grid = grid_of(world)
    if what == NODE:
        return world.homing_node(rate, grid)
    return world.running(
        'bare_cycle.py',
        f'--axes={len(world.names)}',
        f'--rate={rate}',
        f'--grid={grid}',
        *(['--inputs'] if what == TAKING else []),
    )


def grid_of(world: World) -> Path:
    return world.folder / 'grid'


def begin(world: World, what: str) -> None:
    """Wait for setpoints."""
    if what == NODE:
        world.start_homing()
    else:
        world.until(world.heard, 'setpoints')


def lateness(what: str, rate: float, fed: float, axes: int, duration: float) -> Lateness:
    """Run one process and watch its setpoints for a while."""
    world = World(axes, fed)
    try:
        with running(world, what, rate):
            begin(world, what)
            world.listen(WARM_UP)
            heard = world.listen(duration)
    finally:
        world.close()
    due = load(grid_of(world))
    late = [(one.sent - due[one.number]) * 1e6 for one in heard]
    left_out = rate * (heard[-1].sent - heard[0].sent) - (heard[-1].number - heard[0].number)
    return Lateness(
        nth(late, 0.01), nth(late, 0.5), nth(late, 0.99), max(late), max(0.0, left_out)
    )


def processor(
    rate: float, fed: float, axes: int, duration: float, times: int
) -> list[list[float]]:
    """Run all three at the same time; return the share of a core that each uses, %, by time."""
    whats = NODE, BARE, TAKING
    with ExitStack() as ends:
        pairs = []
        for what in whats:
            world = World(axes, fed)
            ends.callback(world.close)
            pairs.append((world, ends.enter_context(running(world, what, rate))))
            begin(world, what)
        time.sleep(WARM_UP)
        used = [[cpu_seconds(child.pid) for _, child in pairs]]
        for _ in range(times):
            time.sleep(duration)
            used.append([cpu_seconds(child.pid) for _, child in pairs])
            for world, _ in pairs:
                world.heard()
    return [
        [100.0 * (after - before) / duration for before, after in pairwise(one)]
        for one in zip(*used, strict=True)
    ]


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield processor time and lateness for each case."""
    duration, repeats, times = (0.5, 1, 1) if quick else (5.0, 3, 12)
    for rate, fed, axes in CASES[1:2] if quick else CASES:
        case = f'{axes} axes, {rate:g} Hz' if axes > 1 else f'1 axis, {rate:g} Hz'
        node, bare, taking = processor(rate, fed, axes, min(duration, 1.0), times)
        goal = GOALS.get((rate, axes))
        cpu = within(f'{case}: processor', '% of a core', node, bare, goal or 1.0)
        yield cpu if goal else cpu._replace(goal='', met=None)
        yield Figure(f'{case}: processor, bare takes the inputs too', '% of a core', node, taking)

        ours, theirs = alternately(
            repeats,
            *(partial(lateness, what, rate, fed, axes, duration) for what in (NODE, BARE)),
            warm_up=False,
        )

        for name in 'p1', 'p50', 'p99', 'max':
            what, of = f'{case}: lateness {name}', attrgetter(name)
            late, bare_late = [*map(of, ours)], [*map(of, theirs)]
            yield (
                within(what, 'µs', late, bare_late, 1.2)
                if name == 'p99'
                else Figure(what, 'µs', late, bare_late)
            )
        yield Figure(
            f'{case}: cycles left out',
            f'of {rate * duration:g}',
            [round(one.left_out) for one in ours],
            [round(one.left_out) for one in theirs],
        )
