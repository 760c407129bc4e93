# SPDX-License-Identifier: Apache-2.0
"""`homing survey`: finds where everything is on a real axis, and writes its layout file."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from ..parameters.axis import DEFINITIONS, AxisParameters, axis_parameters
from ..procedures.states import Error, Input
from ..survey.judgement import Doubt, Survey, judge
from ..survey.passes import Pass, SeenEdge
from ..survey.plan import Move, Plan
from ..survey.report import layout_text
from .common import FAILED, OK, Failure, add_node, console, positive, written
from .held_key import HeldKey
from .live import STATUS, axes_of, connected, full
from .progress import Display

TEXT = """\
Finds where everything is on an axis, and writes the layout file that `homing check` and `homing
run` read. The axis moves. Needs ROS.

It jogs over every switch both ways, at two velocities, no further than --within from where the
axis is. Every bound and stop of a homing run holds; a limit switch ends a motion, and the axis
turns. Hold any key: the axis stops within a second of its release. With --yes no key is needed:
keep a hand on the emergency stop. Ctrl-C stops the axis and waits until it rests; the file has
what was seen till then.
"""

EXAMPLES = f"""\
examples:
  homing survey x --within 0.2
  homing survey x --within 0.2 --velocity 0.005 --yes -o machine.yaml
  homing propose axes.yaml --layout machine.yaml

{STATUS}"""

FAILURE = 'a motion failed, or something makes no sense; the file has what was seen'

#: The part of homing_velocity_fast that is the default velocity.
SLOWLY = 0.1
#: How long to listen to what the diagnostics say of the inputs, s.
LISTEN = 2.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('axis', metavar='AXIS', help='the name of the axis')
    parser.add_argument(
        '--within',
        metavar='D',
        type=positive,
        required=True,
        help='how far from where it is the axis may go, both ways, m or rad',
    )
    parser.add_argument(
        '--velocity',
        metavar='V',
        type=positive,
        help='how fast, m/s or rad/s (default: a tenth of homing_velocity_fast)',
    )
    parser.add_argument(
        '--yes', action='store_true', help='move without a key that is held, and ask nothing'
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        type=Path,
        help='the layout file to write (default: AXIS_layout.yaml); none is overwritten',
    )
    add_node(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    axis = arguments.axis
    path = arguments.output or Path(f'{axis}_layout.yaml')
    if path.exists():
        raise Failure(f'{path} is there already: give the name of another file with -o')
    if not arguments.yes and not sys.stdin.isatty():
        raise Failure('there is no terminal on which a key could be held: give --yes')
    with connected(arguments) as client:
        parameters = _parameters(client, axis)
        velocity = arguments.velocity or SLOWLY * parameters.homing_velocity_fast
        rates = _rates(full(arguments.node), axis)
        state = client.state(axis)
        levels = {
            Input(name): level == 1
            for name, level in zip(state.inputs, state.levels, strict=True)
            if level < 2
        }
        raw = state.position + (state.home_offset if state.homed else 0.0)
        plan = Plan(raw, arguments.within, velocity, parameters.travel)
        unit = parameters.unit
        print(
            f'axis {axis} goes up to {unit.length(arguments.within)} both ways from '
            f'{raw:.6g} {unit}, at {velocity:g} {unit}/s',
            flush=True,
        )
        with _deadman(arguments.yes) as held, Display(console()) as display:
            ended = _make(plan, raw, partial(_jog, client, axis, held, display))
        if not plan.passes:
            raise Failure('nothing was surveyed', status=FAILED)
        if ended is not None and not any(one.edges for one in plan.passes):
            print(f'no edge was met till then: {path} is not written')
            raise ended
        found = judge(parameters, plan.passes, levels, rates)
        about = f'surveyed by `homing survey` within {unit.length(arguments.within)}'
        if ended is not None:
            about += ', and not to its end'
        text = layout_text(axis, found, unit, [about])
        written(path, lambda: _save(path, text))
        _tell(found, path)
        if ended is not None:
            raise ended
        failure = plan.failure
        if failure is not None:
            raise Failure(failure.message, status=FAILED)
        if not arguments.yes:
            for doubt in found.doubts:
                _ask(client, axis, doubt)
    return FAILED if found.doubts else OK


def _parameters(client: Any, axis: str) -> AxisParameters:
    """Return the parameters of the axis in the running node."""
    axes_of(client, 'survey', [axis])
    prefix = f'{axis}.'
    values = client.parameters(*(prefix + name for name in DEFINITIONS))
    plain = {name.removeprefix(prefix): value for name, value in values.items()}
    return axis_parameters(plain, axis)


def _rates(node: str, axis: str) -> dict[Input, float]:
    """Return how often the message of each input comes, Hz; 0: on change."""
    from ..ros.watching import Watcher

    watcher = Watcher(node, [axis])
    try:
        until = time.monotonic() + LISTEN
        while time.monotonic() < until:
            watcher.poll()
            line = watcher.board.axes.get(axis)
            if line is not None and all(one.source != '-' for one in line.inputs.values()):
                break
            time.sleep(0.02)
        line = watcher.board.axes.get(axis)
        told = {} if line is None else {name: one.rate for name, one in line.inputs.items()}
    finally:
        watcher.close()
    return {
        Input(name): float(rate.removesuffix(' Hz')) if rate.endswith(' Hz') else 0.0
        for name, rate in told.items()
        if rate != '-'
    }


@contextmanager
def _deadman(yes: bool) -> Iterator[Callable[[], bool] | None]:
    """Yield what returns whether a key is held; None: no key is needed."""
    if yes:
        yield None
        return
    print('hold any key down; the axis stops when it is released', flush=True)
    with HeldKey() as key:
        yield key.held


def _make(plan: Plan, begin: float, jog: Callable[[float, Move], Pass]) -> BaseException | None:
    """Make the motions of a plan, from where the axis is; return what cut them short, if anything.

    That is Ctrl-C, or a node that is gone: what was seen till then is worth a file.
    """
    move = None
    try:
        while (move := plan.next()) is not None:
            plan.add(jog(begin, move))
            begin = plan.passes[-1].end
    except (KeyboardInterrupt, TimeoutError) as ended:
        if move is not None:
            plan.add(_cut_short(begin, move, ended))
        return ended
    return None


def _cut_short(begin: float, move: Move, ended: BaseException) -> Pass:
    """Return what is known of a motion that was cut short: all, if the axis is known to rest."""
    result = getattr(ended, 'result', None)
    if result is not None:
        return _pass(begin, move, result)
    interrupted = isinstance(ended, KeyboardInterrupt)
    error = Error.Canceled if interrupted else Error.InternalError
    return Pass(begin, begin, move.way * move.velocity, (), error, str(ended) or 'interrupted')


def _jog(
    client: Any,
    axis: str,
    held: Callable[[], bool] | None,
    display: Display,
    begin: float,
    move: Move,
) -> Pass:
    """Make one motion."""
    behind: list[float] = []

    def take(message: Any) -> None:
        done = 1.0 - message.distance_to_go / move.distance
        if 0.3 < done < 0.7:  # at its velocity
            behind.append(move.way * message.state.following_error)
        way = f'{message.distance_to_go:+.4g} to go'
        display.show(axis, str(message.state.state), max(0.0, done), 1.0, way)

    result = client.jog(axis, move.distance, move.velocity, held, take)
    return _pass(begin, move, result, behind)


def _pass(begin: float, move: Move, result: Any, behind: Sequence[float] = ()) -> Pass:
    """Return what the result of a jog tells."""
    state = result.state
    edges = tuple(
        SeenEdge(Input(one.input), one.level, one.position, one.uncertainty, one.velocity)
        for one in result.edges
    )
    error = Error.NoError if result.success else _error(result.message)
    end = state.position + (state.home_offset if state.homed else 0.0)
    message = str(result.message)
    return Pass(begin, end, move.way * move.velocity, edges, error, message, tuple(behind))


def _error(message: str) -> Error:
    """Return the error that a message begins with."""
    name = message.partition(':')[0]
    return Error(name) if name in set(Error) else Error.InternalError


def _save(path: Path, text: str) -> None:
    path.write_text(text, encoding='utf-8')


def _tell(found: Survey, path: Path) -> None:
    for title, texts in (('seen', found.seen), ('not seen', found.unseen)):
        for text in texts:
            print(f'{title}: {text}')
    for doubt in found.doubts:
        print(f'doubt: {doubt.text}{_remedy(doubt)}')
    print(f'wrote {path}')


def _remedy(doubt: Doubt) -> str:
    return f' ({doubt.parameter}: {_plain(doubt.value)})' if doubt.parameter else ''


def _plain(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _ask(client: Any, axis: str, doubt: Doubt) -> None:
    """Ask whether the running node shall have another value; the file is the user's to change."""
    if not doubt.parameter:
        return
    name = f'{axis}.{doubt.parameter}'
    try:
        answer = input(f'set {name} to {_plain(doubt.value)} in the running node? [y/N] ')
    except EOFError:  # Ctrl-D
        return
    if answer.strip().lower() not in ('y', 'yes'):
        return
    value = doubt.value if isinstance(doubt.value, bool | float | int) else str(doubt.value)
    set_now = client.set_parameters(axis, **{doubt.parameter: value})
    if not set_now:
        raise Failure(set_now.message, status=FAILED)
    print(f'{name} is set until the node ends; write it into its parameter file, survey again')
