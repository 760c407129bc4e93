# SPDX-License-Identifier: Apache-2.0
"""`homing record`: records a run of a running node from outside."""

import argparse
import time
from collections.abc import Callable
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any

from ..parameters.definition import InvalidParameters
from .common import FAILED, INTERRUPTED, OK, Failure, add_axes, add_node
from .live import PATIENCE, STATUS, absent, coordinator, full

TEXT = """\
Records the next run of a running homing_node as an MCAP file, by its topics. It reads only. Needs
ROS.

It waits until a run begins, and ends 1 s after all runs that have begun have ended, or with
Ctrl-C. A run that is on is recorded from now on. `homing plot` draws the file.
"""

EXAMPLES = f"""\
examples:
  homing record -o run.mcap
  homing record x -o run.mcap --node /cell_2/homing_node
  homing plot run.mcap

{STATUS}"""

FAILURE = 'the node has died, or is silent; the file has what came until then'

#: A node that says nothing for so long is silent, s: it tells each state once a second.
SILENCE = 5.0
#: How often messages are taken, and written to the disk, s.
POLL_PERIOD, WRITE_PERIOD = 0.02, 1.0
#: After the end of all runs another one may begin within this time, s.
LINGER = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    parser.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        type=Path,
        required=True,
        help='the file, .mcap; it must not exist',
    )
    add_node(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; only here ROS is imported."""
    try:
        from ..ros.asking import IsCoordinator
        from ..ros.run_listener import Listener
    except ImportError as error:
        raise Failure(f'`homing record` needs ROS 2 and mcap ({error})') from None
    path: Path = arguments.output
    if path.suffix != '.mcap':
        raise Failure(f'-o {path}: the file must end in .mcap, or `homing plot` does not know it')
    listener = Listener(full(arguments.node))
    try:
        try:
            axes = _axes(listener, arguments)
        except IsCoordinator as error:
            raise Failure(coordinator(listener.target, 'record', error.nodes)) from None
        try:
            file = path.open('xb')
        except FileExistsError:
            raise Failure(f'{path} is there already: give another -o, or delete it') from None
        except OSError as error:
            raise Failure(f'{path}: {error.strerror}') from None
        try:
            return _record(listener, listener.record(file, axes), axes, path)
        finally:
            with suppress(OSError):  # what was written was flushed
                file.close()
    finally:
        listener.close()


def _axes(listener: Any, arguments: argparse.Namespace) -> list[str]:
    """Find the node; return the axes to record.

    Raises:
        Failure: The node, or an axis that was asked for, is not there.
        IsCoordinator: The node is a coordinator.
    """
    until = time.monotonic() + PATIENCE
    while not listener.is_there():
        if time.monotonic() > until:
            raise Failure(*absent(listener.target, listener.nodes(), 'record'))
        time.sleep(POLL_PERIOD)
    try:
        answered = listener.ask(PATIENCE)
    except InvalidParameters as error:
        raise Failure(
            f'{listener.target} is no homing node whose parameters this version knows',
            *error.faults,
        ) from None
    if not answered:
        raise Failure(
            f'{listener.target} is there, but is silent: no parameters within {PATIENCE:g} s',
            status=FAILED,
        )
    there = list(listener.checked.axes)
    for axis in arguments.axes:
        if axis not in there:
            raise Failure(f'{axis!r} is none of the axes {", ".join(there)}')
    return list(dict.fromkeys(arguments.axes)) or there


def _record(listener: Any, runs: Any, axes: list[str], path: Path) -> int:
    """Record until all runs have ended; return the status.

    Raises:
        Failure: The node has died or is silent, the disk is full, or Ctrl-C.
    """
    try:
        _wait(listener, runs, lambda: all(listener.states.get(axis, 0) > 1 for axis in axes))
        if not runs.begun:
            print(f'waiting for a run of {", ".join(axes)} of {listener.target}', flush=True)
        while True:
            _wait(listener, runs, lambda: runs.over)
            _wait(listener, runs, lambda: runs.running, LINGER)
            if runs.over:
                break
        runs.finish('Cut')
    except KeyboardInterrupt:
        raise Failure('interrupted', *_end(runs, path), status=INTERRUPTED) from None
    except Failure as failure:
        raise Failure(*failure.lines, *_end(runs, path), status=failure.status) from None
    except OSError as error:
        raise Failure(f'{path}: {error.strerror or error}') from None
    told = ', '.join(f'{axis} {error}' for axis, error in runs.ended.items())
    print(f'wrote {path}: {told}')
    return OK


def _end(runs: Any, path: Path) -> list[str]:
    """End the file early; return what to say of it."""
    if not runs.begun:
        path.unlink()
        return [f'no run has begun: {path} is not written']
    try:
        runs.finish('Cut')
    except OSError as error:
        return [f'{path}: {error.strerror or error}']
    return [f'{path} has what came until now']


def _wait(listener: Any, runs: Any, condition: Callable[[], object], longest: float = inf) -> None:
    """Take what comes until a condition holds, or for the longest time, s.

    Raises:
        Failure: The node has said nothing for too long.
        OSError: The file cannot be written.
    """
    begun = time.monotonic()
    due = begun + WRITE_PERIOD
    while True:
        listener.poll()
        now = time.monotonic()
        if now > due:
            due = now + WRITE_PERIOD
            runs.flush()
        if condition() or now > begun + longest:
            return
        silent = now - listener.heard
        if silent > SILENCE:
            if listener.target in listener.nodes():
                text = f'{listener.target} has been silent for {silent:.0f} s, though it is listed'
            else:
                text = f'{listener.target} has ended, or is out of reach'
            raise Failure(text, status=FAILED)
        time.sleep(POLL_PERIOD)
