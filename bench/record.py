# SPDX-License-Identifier: Apache-2.0
"""What the records of the runs cost: processor time and lateness, with and without them.

Two nodes home at the same time, one that records and one that does not: second by second they see
the same machine. Lateness is measured of one after the other.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from itertools import pairwise
from pathlib import Path

from figures import Figure, alternately, nth, within
from graph import World, cpu_seconds
from grid import load

#: Largest processor time against a node that does not record, and the numbers of axes.
GOAL, AXES = 1.03, (1, 8)
RATE, FED, WARM_UP = 250.0, 500.0, 1.0
#: What switches the records off.
WITHOUT = ('-p', "record:=''")


def processor(axes: int, duration: float, times: int) -> list[list[float]]:
    """Return the share of a core that a node uses that records and one that does not, %."""
    with ExitStack() as ends:
        pairs = []
        for more in ((), WITHOUT):
            world = World(axes, FED)
            ends.callback(world.close)
            child = ends.enter_context(world.homing_node(RATE, None, *more))
            world.start_homing()
            pairs.append((world, child))
        time.sleep(WARM_UP)
        used = [[cpu_seconds(child.pid) for _, child in pairs]]
        for _ in range(times):
            time.sleep(duration)
            used.append([cpu_seconds(child.pid) for _, child in pairs])
            for world, _ in pairs:
                world.heard()
        records = [list(world.folder.rglob('*.mcap')) for world, _ in pairs]
        assert [len(found) for found in records] == [axes, 0], records
        assert all(path.stat().st_size > 10_000 for path in records[0])
    return [
        [100.0 * (after - before) / duration for before, after in pairwise(one)]
        for one in zip(*used, strict=True)
    ]


def lateness(more: tuple[str, ...], axes: int, duration: float) -> float:
    """Return how late 99 of 100 setpoints are at most, µs."""
    world = World(axes, FED)
    grid: Path = world.folder / 'grid'
    try:
        with world.homing_node(RATE, grid, *more):
            world.start_homing()
            world.listen(WARM_UP)
            heard = world.listen(duration)
    finally:
        world.close()
    due = load(grid)
    return nth([(one.sent - due[one.number]) * 1e6 for one in heard], 0.99)


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the costs for each number of axes."""
    duration, repeats, times = (1.0, 1, 1) if quick else (5.0, 3, 12)
    for axes in AXES[:1] if quick else AXES:
        case = f'{axes} axes, {RATE:g} Hz' if axes > 1 else f'1 axis, {RATE:g} Hz'
        ours, bare = processor(axes, duration, times)
        yield within(f'{case}: processor, against record off', '% of a core', ours, bare, GOAL)
        late, bare_late = alternately(
            repeats,
            *(partial(lateness, more, axes, duration) for more in ((), WITHOUT)),
            warm_up=False,
        )
        yield Figure(f'{case}: lateness p99', 'µs', late, bare_late)
