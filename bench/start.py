# SPDX-License-Identifier: Apache-2.0
"""Start of the node: from its process's start to its first answer.

The counterpart is an rclpy node with one service. The package is compiled to bytecode first, as
every installation of it is. Who asks is a process of its own that announces itself often
(eager.xml): whether two processes find each other at the first announcement is a matter of luck,
and the next one comes 0.1 to 3 s later.
"""

import compileall
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from figures import Figure, alternately, within
from graph import HERE, World

import homing_node

#: A request that was made before the answer's way back was found is repeated after this, s.
REPEAT = 0.1
BARE = 'bare'


def await_answer(world: World) -> None:
    """Ask the same service until the first answer has come."""
    answer: Any = None
    asked = 0.0

    def answered() -> bool:
        nonlocal answer, asked
        if time.perf_counter() - asked > REPEAT:
            answer, asked = world.call('a0/cancel'), time.perf_counter()
        return bool(answer.done())

    world.until(answered, 'an answer')


def ask(what: str) -> float:
    """Start a process, bare or with a number of axes; return when it gave its first answer, s."""
    world = World(1 if what == BARE else int(what), 0.0)
    try:
        running = world.running('bare_service.py') if what == BARE else world.homing_node(250.0)
        begin = time.perf_counter()
        with running:
            await_answer(world)
            return time.perf_counter() - begin
    finally:
        world.close()


def start(what: str) -> float:
    """Let a process of its own ask."""
    environment = {**os.environ, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(HERE / 'eager.xml')}
    asked = subprocess.run(
        [sys.executable, __file__, what], env=environment, check=True, stdout=subprocess.PIPE
    )
    return float(asked.stdout)


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the start of a node with three axes, and with many."""
    compileall.compile_dir(Path(homing_node.__file__).parent, quiet=1)
    repeats = 1 if quick else 20
    three, many, bare = alternately(
        repeats, partial(start, '3'), partial(start, '32'), partial(start, BARE), warm_up=not quick
    )
    yield within('3 axes', 's', three, bare, 1.5)
    yield Figure('32 axes', 's', many, bare)


if __name__ == '__main__':
    print(ask(sys.argv[1]))
