# SPDX-License-Identifier: Apache-2.0
"""`homing watch`: a live table of the running machine."""

import argparse
import json
import os
import time
from typing import Any

from rich.live import Live

from .common import FAILED, OK, Failure, add_axes, add_node, console
from .live import PATIENCE, STATUS, absent, full
from .watch_table import table, text_of

TEXT = """\
Shows a live table of the axes: state, home, position, and every input with its level after
polarity, its age, how often it comes, and its topic. It reads only. Needs ROS.

An input whose level has changed stands out for some seconds: walk along the machine, press each
switch, and see which one it is. Where the output is no terminal, each change is a line.
"""

EXAMPLES = f"""\
examples:
  homing watch
  homing watch x y
  homing watch --once
  homing watch --once --json | jq '.axes.x.inputs'
  homing watch --node /cell_2/homing_node | tee changes.txt

{STATUS}"""

FAILURE = 'the node has died, or is silent'

#: A node that says nothing for so long is silent, s: it tells each state once a second.
SILENCE = 5.0
#: How often messages are taken, s.
POLL_PERIOD = 0.1
#: By how much drawing the table gives way to a node on the same machine: its cycle goes first.
GIVES_WAY = 10
#: The table takes no more than this part of a core.
SHARE = 0.08


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_axes(parser)
    add_node(parser)
    parser.add_argument('--once', action='store_true', help='show the present state, and end')
    parser.add_argument(
        '--json',
        action='store_true',
        help='print JSON: a line for each change, or with --once one',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command; only here ROS is imported."""
    try:
        from ..ros.watching import Watcher
    except ImportError as error:
        raise Failure(f'`homing watch` needs ROS 2 ({error})') from None
    node = full(arguments.node)
    watcher = Watcher(node, arguments.axes)
    try:
        _find(watcher, arguments)
        if arguments.once:
            _show_once(watcher, arguments)
        elif arguments.json or not console().is_terminal:
            _tell(watcher, arguments.json)
        else:
            _show(watcher)
    finally:
        watcher.close()
    return OK


def _find(watcher: Any, arguments: argparse.Namespace) -> None:
    """Wait for the state of each axis, and what the diagnostics say of its inputs.

    Raises:
        Failure: The node, or an axis that was asked for, is not there.
    """
    until = time.monotonic() + PATIENCE
    board = watcher.board
    complete = None
    while True:
        watcher.poll()
        missing = [axis for axis in arguments.axes if axis not in board.axes]
        now = time.monotonic()
        if board.axes and not missing:
            complete = complete or now
            known = all(
                one.source != '-' for axis in board.axes.values() for one in axis.inputs.values()
            )
            # A coordinator knows no inputs, and an axis may be found after another.
            if now - complete > (0.3 if known else 1.5):
                return
        if now > until:
            break
        time.sleep(0.02)
    there = watcher.nodes()
    if watcher.target not in there:
        raise Failure(*absent(watcher.target, there, 'watch'))
    unknown = [axis for axis in arguments.axes if axis not in watcher.found]
    if unknown and watcher.found:
        raise Failure(f'{unknown[0]!r} is none of the axes {", ".join(sorted(watcher.found))}')
    raise Failure(
        f'{watcher.target} is there, but is silent: no state of an axis within {PATIENCE:g} s',
        status=FAILED,
    )


def _alive(watcher: Any) -> None:
    """Raise Failure if the node has said nothing for too long."""
    silent = time.monotonic() - watcher.board.heard
    if silent <= SILENCE:
        return
    if watcher.target in watcher.nodes():
        text = f'{watcher.target} has been silent for {silent:.0f} s, though it is still listed'
    else:
        text = f'{watcher.target} has ended, or is out of reach'
    raise Failure(text, status=FAILED)


def _as_dict(watcher: Any) -> dict[str, Any]:
    axes = {name: one.as_dict() for name, one in sorted(watcher.board.axes.items())}
    return {'node': watcher.target, 'axes': axes}


def _show_once(watcher: Any, arguments: argparse.Namespace) -> None:
    if arguments.json:
        print(json.dumps(_as_dict(watcher), indent=2))
    else:
        screen = console()
        if screen.is_terminal:
            screen.print(table(watcher.board, time.monotonic(), screen.width))
        else:
            print('\n'.join(text_of(watcher.board)))


def _tell(watcher: Any, as_json: bool) -> None:
    """Print each change as a line."""
    begun = time.monotonic()
    if as_json:
        print(json.dumps(_as_dict(watcher)), flush=True)
    else:
        print('\n'.join(text_of(watcher.board)), flush=True)
    while True:
        time.sleep(POLL_PERIOD)
        changes = watcher.poll()
        if as_json and changes:
            print(json.dumps(_as_dict(watcher)), flush=True)
        elif not as_json:
            for one in changes:
                print(f'{time.monotonic() - begun:8.1f} s  {one.axis}: {one.text}', flush=True)
        _alive(watcher)


def _show(watcher: Any) -> None:
    """Show the table, and keep it fresh."""
    os.nice(GIVES_WAY)
    screen = console()
    with Live(console=screen, auto_refresh=False, transient=False) as live:
        due = 0.0
        while True:
            watcher.poll()
            now = time.monotonic()
            if now >= due:
                begun = time.thread_time()
                live.update(table(watcher.board, now, screen.width, screen.height), refresh=True)
                due = now + max(POLL_PERIOD, (time.thread_time() - begun) / SHARE)
            _alive(watcher)
            time.sleep(POLL_PERIOD)
