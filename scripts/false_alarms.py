# SPDX-License-Identifier: Apache-2.0
"""How often the memory is wrong: simulated machines on which nothing moves.

false_alarms.py [RUNS]: counts the alarms in so many runs of each kind of machine (default 30000).
"""

import random
import sys
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from homing_node.memory.series import Series
from homing_node.memory.trends import trend_of

UM = 1e-6


class Machine(NamedTuple):
    """How the homes of a machine spread, and the uncertainty that it knows, m."""

    name: str
    home: Callable[[random.Random], float]
    uncertainty: float


MACHINES = (
    Machine('normal, 2 µm; nothing known', lambda rng: rng.gauss(0.1, 2 * UM), 1e-9),
    Machine('even, ± 2 µm; known', lambda rng: rng.uniform(0.1 - 2 * UM, 0.1 + 2 * UM), 2 * UM),
    Machine(
        'normal, 2 µm, in counts of 1 µm', lambda rng: round(rng.gauss(1e5, 2.0)) * UM, 1 * UM
    ),
)


def alarms(machine: Machine, runs: int, seed: int) -> Counter[str]:
    """Return the alarms of one machine: each that began, by its kind."""
    rng, series, found = random.Random(seed), Series(), Counter[str]()
    before = ''
    for number in range(1, runs + 1):
        series.add(machine.home(rng), machine.uncertainty, number)
        trend = trend_of(list(series.values))
        present = 'moved' if series.suspicious >= 2 else trend.kind if trend else ''
        found[present] += bool(present and present != before)
        before = present
    return +found


def main() -> None:
    """Print the alarms for machines of a short and of a long life."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 30_000
    for machine in MACHINES:
        for life in (60, 300, 1000):
            found = Counter[str]()
            for seed in range(runs // life):
                found += alarms(machine, life, seed)
            rate = 1e4 * sum(found.values()) / runs
            print(
                f'{machine.name}; {life} runs each: {rate:.2f} in 10 000 runs {dict(found)}',
                flush=True,
            )


if __name__ == '__main__':
    main()
