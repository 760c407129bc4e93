"""Cycle of the node while all its axes home: processor time and lateness.

The counterpart is an rclpy loop in a thread of its own that publishes the same message, and, where
that is said, also takes the same inputs. Lateness: from when a cycle was due to the time stamp
that the middleware gave its setpoints.
"""

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

from figures import Figure, alternately, nth, within
from graph import Heard, World, cpu_seconds
from grid import load

#: Rates of the cycle and of the feedback, Hz, and numbers of axes.
CASES = tuple((rate, fed, axes) for rate, fed in ((250.0, 500.0), (1000.0, 1000.0))
              for axes in (1, 8, 32))
WARM_UP = 1.0  # s


class Load(NamedTuple):
    """Share of a core in %, lateness in µs, and how many cycles were left out."""

    cpu: float
    p50: float
    p99: float
    worst: float
    left_out: float


def measure(what: str, rate: float, fed: float, axes: int, duration: float) -> Load:
    """Run one process and watch it for a while."""
    world = World(axes, fed)
    grid = world.folder / 'grid'
    try:
        if what == 'homing_node':
            running = world.homing_node(rate, str(grid))
        else:
            running = world.running(
                'bare_cycle.py', f'--axes={axes}', f'--rate={rate}', f'--grid={grid}',
                *(['--inputs'] if what == 'inputs' else []))
        with running as child:
            if what == 'homing_node':
                world.start_homing()
            else:
                world.until(world.heard, 'setpoints')
            world.listen(WARM_UP)
            before = cpu_seconds(child.pid)
            heard = world.listen(duration)
            used = cpu_seconds(child.pid) - before
    finally:
        world.close()
    late = lateness(heard, load(grid))
    left_out = rate * (heard[-1].sent - heard[0].sent) - (heard[-1].number - heard[0].number)
    return Load(100.0 * used / duration, nth(late, 0.5), nth(late, 0.99), max(late),
                max(0.0, left_out))


def lateness(heard: list[Heard], due: list[float]) -> list[float]:
    """Return how late each message was, µs."""
    return [(one.sent - due[one.number]) * 1e6 for one in heard]


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield processor time and lateness for each case."""
    duration, repeats = (0.5, 1) if quick else (5.0, 3)
    for rate, fed, axes in CASES[1:2] if quick else CASES:
        node, bare, taking = alternately(
            repeats,
            *(partial(measure, what, rate, fed, axes, duration)
              for what in ('homing_node', 'cycle', 'inputs')), warm_up=False)
        case = f'{axes} axes, {rate:g} Hz' if axes > 1 else f'1 axis, {rate:g} Hz'

        def of(loads: list[Load], name: str) -> list[float]:
            return [getattr(one, name) for one in loads]

        cpu = within(f'{case}: processor', '% of a core', of(node, 'cpu'), of(bare, 'cpu'), 2.0)
        yield cpu if axes == 8 else cpu._replace(goal='', met=None)
        yield Figure(f'{case}: processor, bare takes the inputs too', '% of a core',
                     of(node, 'cpu'), of(taking, 'cpu'))
        yield Figure(f'{case}: lateness p50', 'µs', of(node, 'p50'), of(bare, 'p50'))
        yield within(f'{case}: lateness p99', 'µs', of(node, 'p99'), of(bare, 'p99'), 1.2)
        yield Figure(f'{case}: lateness max', 'µs', of(node, 'worst'), of(bare, 'worst'))
        yield Figure(f'{case}: cycles left out', f'of {rate * duration:g}',
                     [round(n) for n in of(node, 'left_out')],
                     [round(n) for n in of(bare, 'left_out')])
