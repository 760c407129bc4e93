"""The command `homing`: know before you move. Needs no ROS."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from . import layout_file, yaml_file
from .check import Finding, Severity, Timing, check, errors
from .configuration import Configuration
from .layout import AxisLayout
from .layout_file import InvalidLayout, LayoutFile
from .palette import state_colour
from .parameters import AxisParameters
from .procedures import PROCEDURES
from .spec import InvalidParameters
from .states import HomeType, Input, State
from .sweep import Trial, rehearse_from, starts, sweep, transport_of

OK, FAILED, USAGE = 0, 1, 2

STATUS = """\
exit status:
  0  all is well
  1  {failed}
  2  wrong arguments, or a file that cannot be read or written
"""

MAIN = """\
Checks, rehearses and draws the homing of machine axes. Nothing moves, and no ROS is needed.

  homing check axes.yaml --layout machine.yaml     prove a configuration before the first motion
  homing run axes.yaml --layout machine.yaml       rehearse it: how long, which way, where to
  homing plot run.npz                              draw a run
  homing diagram HSHS                              draw what a home type does

`homing COMMAND --help` teaches each of them.
"""

CHECK = """\
Checks the parameters of homing_node before anything moves, and says of each fault why it is
one, the number, and the value that would be right.

With a layout (where the switches, hard stops and index pulses are; what you do not know you
leave out) it computes how far the axis goes on behind every switch: until the message has come,
until the deceleration has grown, until the axis rests; and compares that with the room before
the next switch and the hard stop, at both ends, at the speed at which this home type comes there.
"""

CHECK_EXAMPLES = """\
examples:
  homing check axes.yaml
  homing check axes.yaml --layout machine.yaml
  homing check axes.yaml --layout machine.yaml --feedback-rate 100 --accuracy 1e-5
  homing check axes.yaml --layout machine.yaml --json | jq '.findings[].right'

a layout:
  x:
    hard_stops: [-0.005, 0.205]             # raw positions, m; null: not known
    negative_limit_switch: [null, 0.0]      # on from the hard stop up to here
    positive_limit_switch: [0.195, null]
    home_switch: [0.150, 0.160]
    home_switch_hysteresis: 0.00005
    index_pitch: 0.01                       # pulses at index_offset + k * index_pitch
    index_offset: 0.0037
    lag: 0.005                              # s, from the command to the feedback
  The parameter file of simulated_axes is a layout, too.

severities:
  error    a run fails, or the axis hits something
  warning  it works, but not as it should, or not from everywhere
  info     worth knowing

"""

RUN = """\
Rehearses homing against a simulated axis, more than a hundred times faster than the real thing:
the same code that drives the machine, the switches where the layout has them.
"""

RUN_EXAMPLES = """\
examples:
  homing run axes.yaml --layout machine.yaml
  homing run axes.yaml --layout machine.yaml --axis x --from 0.18 --plot run.png
  homing run axes.yaml --layout machine.yaml --axis x --type HSZPulse
  homing run axes.yaml --layout machine.yaml --axis x --save run.npz   (or .csv)
  homing run axes.yaml --layout machine.yaml --axis x --all-starts --plot starts.png

"""

PLOT = """\
Draws a saved run: position, velocity and acceleration over time, the home states as coloured
bands, switch edges where they were taken.
"""

PLOT_EXAMPLES = """\
examples:
  homing plot run.npz                                 writes run.png
  homing plot run.npz -o run.svg --layout machine.yaml --axis x
  homing plot run.csv -o position.png --panels position

"""

DIAGRAM = """\
Draws the state diagram of a home type, from the same table that the node executes.
"""

DIAGRAM_EXAMPLES = """\
examples:
  homing diagram HSHS                                 Mermaid, for Markdown
  homing diagram HSReverseZPulse -o diagram.svg

"""


class Failure(Exception):
    """What ends a command: lines for the user, and the exit status."""

    def __init__(self, *lines: str, status: int = USAGE) -> None:
        self.lines, self.status = lines, status


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    arguments = _parser().parse_args(argv)
    command: Callable[[argparse.Namespace], int] = arguments.command
    try:
        return command(arguments)
    except Failure as failure:
        for line in failure.lines:
            print(f'homing: {line}', file=sys.stderr)
        return failure.status
    except BrokenPipeError:  # what reads us has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK


# ------------------------------------------------------------------------------------- the words


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='homing', description=MAIN, formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=STATUS.format(failed='a finding is an error, or a run failed'))
    commands = parser.add_subparsers(metavar='COMMAND', required=True)

    def add(
        name: str, command: Callable[[argparse.Namespace], int], text: str, examples: str,
        failed: str, **options: Any,
    ) -> argparse.ArgumentParser:
        made = commands.add_parser(
            name, help=text.partition('.')[0].partition(':')[0].partition(',')[0],
            description=text, epilog=examples + STATUS.format(failed=failed),
            formatter_class=argparse.RawDescriptionHelpFormatter)
        made.set_defaults(command=command)
        return made

    one = add('check', _check, CHECK, CHECK_EXAMPLES, 'an error was found')
    _add_configuration(one)
    one.add_argument('--layout', metavar='LAYOUT', type=Path,
                     help='where things are along the axes (YAML)')
    _add_timing(one)
    one.add_argument('--accuracy', metavar='M', type=_positive,
                     help='how well home must be known, m or rad')
    one.add_argument('--axis', metavar='NAME', help='only this axis')
    one.add_argument('--json', action='store_true', help='print the findings as JSON')

    one = add('run', _run, RUN, RUN_EXAMPLES, 'a run failed, or hit a hard stop')
    _add_configuration(one)
    one.add_argument('--layout', metavar='LAYOUT', type=Path, required=True,
                     help='where things are along the axes (YAML)')
    one.add_argument('--axis', metavar='NAME', help='only this axis (default: all)')
    one.add_argument('--from', metavar='POSITION', type=float, dest='start',
                     help="raw start position (default: the layout's start)")
    one.add_argument('--type', metavar='TYPE', choices=list(map(str, HomeType)),
                     help='another home type than the configured one')
    one.add_argument('--all-starts', action='store_true',
                     help='run from everywhere along the travel, and draw what becomes of it')
    one.add_argument('--starts', metavar='N', type=_count, default=101,
                     help='how many start positions (default: %(default)s)')
    _add_timing(one)
    one.add_argument('--save', metavar='FILE', type=Path,
                     help='save the course: .npz, or .csv for spreadsheets')
    one.add_argument('--plot', metavar='FILE', type=Path,
                     help='draw it: .png, .svg or .pdf (--all-starts: default AXIS_starts.png)')
    one.add_argument('--json', action='store_true', help='print the results as JSON')

    one = add('plot', _plot, PLOT, PLOT_EXAMPLES, 'the file holds no course')
    one.add_argument('record', metavar='RECORD', type=Path,
                     help='a course saved by `homing run --save` (.npz or .csv)')
    one.add_argument('-o', '--output', metavar='FILE', type=Path,
                     help='.png, .svg or .pdf (default: RECORD with .png)')
    one.add_argument('--layout', metavar='LAYOUT', type=Path,
                     help='draw the switches and hard stops of this layout, too')
    one.add_argument('--axis', metavar='NAME',
                     help='the axis in the layout (default: the only one, or that of the record)')
    one.add_argument('--panels', choices=('all', 'position', 'profile'), default='all',
                     help='the position diagram, the profile, or both')
    one.add_argument('--unit', choices=('m', 'rad'), default='m')

    one = add('diagram', _diagram, DIAGRAM, DIAGRAM_EXAMPLES, 'never')
    one.add_argument('type', metavar='TYPE', choices=list(map(str, HomeType)),
                     help=', '.join(HomeType))
    one.add_argument('--format', choices=('mermaid', 'svg'),
                     help="default: svg where FILE's name ends so, else mermaid")
    one.add_argument('-o', '--output', metavar='FILE', type=Path, help='default: the terminal')
    return parser


def _add_configuration(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('config', metavar='CONFIG', type=Path,
                        help='parameter file of homing_node (YAML)')
    parser.add_argument('--node', metavar='NAME', default=yaml_file.NODE,
                        help='the node that the parameters are for (default: %(default)s)')


def _add_timing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--feedback-rate', metavar='HZ', type=_positive,
                        help='how often joint_states come (default: as the layout file says)')
    parser.add_argument(
        '--latency', metavar='S', type=_not_negative,
        help="from a switch's edge until the setpoint that answers it takes effect "
             f"(default: the layout file's dead_time, else {Timing().latency:g} s)")


def _positive(text: str) -> float:
    number = float(text)
    if not 0.0 < number < float('inf'):
        raise argparse.ArgumentTypeError(f'{text} is not a number > 0')
    return number


def _not_negative(text: str) -> float:
    return 0.0 if float(text) == 0.0 else _positive(text)


def _count(text: str) -> int:
    number = int(text)
    if not 2 <= number <= 100_000:
        raise argparse.ArgumentTypeError(f'{text} is not a number from 2 to 100000')
    return number


# ------------------------------------------------------------------------------------- the files


def _configuration(arguments: argparse.Namespace) -> Configuration:
    return yaml_file.load(arguments.config, arguments.node)


def _layout(path: Path | None) -> LayoutFile | None:
    try:
        return layout_file.load(path) if path else None
    except InvalidLayout as error:
        raise Failure(*error.faults) from None


def _timing(arguments: argparse.Namespace, layout: LayoutFile | None) -> Timing:
    rate, latency = arguments.feedback_rate, arguments.latency
    if layout is not None:
        rate = layout.feedback_rate if rate is None else rate
        latency = layout.dead_time if latency is None else latency
    return Timing(
        feedback_rate=rate, latency=Timing().latency if latency is None else latency,
        accuracy=getattr(arguments, 'accuracy', None))


def _only(axis: str | None, axes: Mapping[str, AxisParameters]) -> dict[str, AxisParameters]:
    if axis is None:
        return dict(axes)
    if axis not in axes:
        raise Failure(f'--axis: {axis!r} is none of the axes {", ".join(axes)}')
    return {axis: axes[axis]}


def _written(path: Path, write: Callable[[], None]) -> None:
    """Write a file; what goes wrong is the user's to know."""
    try:
        write()
    except OSError as error:
        raise Failure(f'{path}: {error.strerror or error}') from None
    except ValueError as error:
        raise Failure(f'{path}: {str(error).removeprefix(f"{path}: ")}') from None


def _console() -> Console:
    return Console(highlight=False, soft_wrap=False)


# ----------------------------------------------------------------------------------------- check


COLOURS = {Severity.error: 'bold red', Severity.warning: 'yellow', Severity.info: 'cyan'}


def _check(arguments: argparse.Namespace) -> int:
    layout = _layout(arguments.layout)
    try:
        configuration = _configuration(arguments)
    except InvalidParameters as error:
        if not arguments.config.is_file():
            raise Failure(*error.faults) from None
        found = [_fault(fault) for fault in error.faults]
    else:
        axes = _only(arguments.axis, configuration.axes)
        found = [finding for finding in check(
            configuration, None if layout is None else layout.layouts,
            _timing(arguments, layout)) if finding.axis in axes]
    failed = bool(errors(found))
    if arguments.json:
        print(json.dumps({'ok': not failed, 'findings': [one.as_dict() for one in found]},
                         indent=2))
    else:
        _show_findings(_console(), found, str(arguments.config))
    return FAILED if failed else OK


def _fault(text: str) -> Finding:
    """Return a finding that says what is wrong in the file itself."""
    return Finding(Severity.error, '', 'configuration', text, 'the node does not start with it')


def _show_findings(console: Console, found: Sequence[Finding], name: str) -> None:
    counts = {severity: sum(one.severity is severity for one in found) for severity in Severity}
    words = [f'{count} {severity}{"s" if count > 1 and severity is not Severity.info else ""}'
             for severity, count in counts.items() if count]
    summary = f'{name}: {", ".join(words) or "nothing found"}'
    if not console.is_terminal:
        for one in found:
            where = f'axis {one.axis}: ' if one.axis else ''
            remedy = f' [{one.remedy}]' if one.remedy else ''
            print(f'{one.severity}: {where}{one.check}: {one.what}; {one.why}{remedy}')
        print(summary)
        return
    for axis in dict.fromkeys(one.axis for one in found):
        table = Table(title=f'axis {axis}' if axis else None, title_justify='left',
                      title_style='bold', show_header=False, box=None, padding=(0, 2, 1, 0))
        table.add_column(no_wrap=True)
        table.add_column(overflow='fold')
        for one in found:
            if one.axis == axis:
                text = Text(one.what)
                text.append(f'\n{one.why}', style='dim')
                if one.remedy:
                    text.append('\n→ ', style='green').append(one.remedy, style='bold green')
                table.add_row(Text(f'{one.severity}\n{one.check}', style=COLOURS[one.severity]),
                              text)
        console.print(table)
    style = 'bold red' if counts[Severity.error] else 'bold green'
    console.print(Text(summary, style=style))


# ------------------------------------------------------------------------------------------- run


def _run(arguments: argparse.Namespace) -> int:
    layout = _layout(arguments.layout)
    assert layout is not None
    try:
        configuration = _configuration(arguments)
    except InvalidParameters as error:
        raise Failure(*error.faults) from None
    axes = _only(arguments.axis, configuration.axes)
    alone = len(axes) == 1
    for option in ('start', 'save', 'plot'):
        if getattr(arguments, option) is not None and not alone:
            name = 'from' if option == 'start' else option
            raise Failure(f'--{name} is for one axis; say which: --axis {" or ".join(axes)}')
    timing = replace(_timing(arguments, layout), update_rate=configuration.update_rate)
    told: list[dict[str, object]] = []
    good = True
    for axis, parameters in axes.items():
        parameters = _with_type(parameters, arguments.type, axis)
        where = _place(arguments, layout, axis, parameters)
        if arguments.all_starts:
            good &= _sweep_axis(arguments, axis, parameters, where, timing, told)
        else:
            good &= _run_axis(arguments, axis, parameters, where, timing, told)
    if arguments.json:
        print(json.dumps({'ok': good, 'runs': told}, indent=2))
    return OK if good else FAILED


def _with_type(parameters: AxisParameters, home_type: str | None, axis: str) -> AxisParameters:
    if home_type is None:
        return parameters
    parameters = replace(parameters, home_type=HomeType(home_type))
    faults = parameters.cross_check()
    if faults:
        raise Failure(*(f'--type {home_type}: {axis}.{fault}' for fault in faults))
    return parameters


def _place(
    arguments: argparse.Namespace, layout: LayoutFile, axis: str, parameters: AxisParameters
) -> AxisLayout:
    """Return an axis's layout if it has all that a run needs."""
    path, where = arguments.layout, layout.layouts.get(axis)
    if where is None:
        raise Failure(f'{path}: no axis {axis!r} in it, only {", ".join(layout.layouts)}')
    missing: list[Input] = [
        name for name in parameters.inputs if name not in where.switches
        and name not in (Input.SERVO_ENABLED, Input.Z_PULSE, Input.TOUCH_PROBE)]
    used = parameters.procedure.inputs
    if Input.Z_PULSE in used and (not where.index_pitch or isnan(where.index_offset)):
        missing.append(Input.Z_PULSE)
    if Input.TOUCH_PROBE in used and where.touch_probe is None:
        missing.append(Input.TOUCH_PROBE)
    if missing:
        raise Failure(*(
            f'{path}: axis {axis}: a run needs to know where {name} is, which '
            f'{arguments.config} has in switches' for name in missing))
    low, high = where.hard_stops
    if arguments.start is not None and not low <= arguments.start <= high:
        raise Failure(f'--from: {arguments.start:g} is beyond the hard stops of axis {axis}, '
                      f'{low:g} and {high:g}')
    if isnan(where.index_offset):
        where = replace(where, index_pitch=0.0, index_offset=0.0)
    return where


def _run_axis(
    arguments: argparse.Namespace, axis: str, parameters: AxisParameters, where: AxisLayout,
    timing: Timing, told: list[dict[str, object]],
) -> bool:
    trial = rehearse_from(parameters, where, transport_of(timing), arguments.start, axis)
    title = f'{axis}: {parameters.home_type} from {trial.start:g}'
    files = []
    if arguments.save:
        from . import record
        _written(arguments.save, lambda: record.save(arguments.save, trial.course, title))
        files.append(arguments.save)
    if arguments.plot:
        from . import plot
        _written(arguments.plot, lambda: plot.save(arguments.plot, trial.course, where, title))
        files.append(arguments.plot)
    if arguments.json:
        told.append(_as_dict(axis, parameters, trial))
    else:
        _show_run(_console(), axis, parameters, trial, files)
    return trial.success


def _as_dict(axis: str, parameters: AxisParameters, trial: Trial) -> dict[str, object]:
    outcome = trial.course.outcome
    return {
        'axis': axis, 'home_type': str(parameters.home_type), 'start': trial.start,
        'success': trial.success, 'error': trial.error,
        'message': outcome.message if outcome else '',
        'time': trial.course.duration,
        'home_position_raw': outcome.home_position_raw if outcome and outcome.success else None,
        'true_home': trial.true_home, 'off': trial.off,
        'uncertainty': outcome.uncertainty if outcome and outcome.success else None,
        'states': [stretch._asdict() for stretch in trial.stretches],
    }


def _show_run(
    console: Console, axis: str, parameters: AxisParameters, trial: Trial, files: Sequence[Path]
) -> None:
    outcome = trial.course.outcome
    assert outcome is not None
    lines = []
    if trial.hits is not None:
        lines.append(f'the axis ran into the hard stop at {trial.hits:g}')
    if outcome.success:
        known = '' if trial.off is None else (
            f'; true {trial.true_home:.9g}, off by {abs(trial.off):.2g}')
        lines += [f'home position {outcome.home_position_raw:.9g} (raw){known}, known to within '
                  f'{outcome.uncertainty:.2g}',
                  f'reads {parameters.home_position:g} at '
                  f'{outcome.home_offset + parameters.home_position:.9g} (raw)']
    else:
        lines.append(f'{outcome.error}: {outcome.message}')
    seconds = f'{trial.course.duration:.3f} s'
    verdict = f'homed in {seconds}' if trial.success else f'failed after {seconds}'
    head = f'axis {axis}: {parameters.home_type} {parameters.home_direction} from {trial.start:g}'
    lines.append(f'rehearsed in {trial.took:.3f} s, {trial.speed:.0f} times real time')
    lines += [f'wrote {path}' for path in files]
    if not console.is_terminal:
        print(f'{head}: {verdict}')
        for one in trial.stretches:
            print(f'  {one.begin:8.3f} s  {one.end - one.begin:8.3f} s  {one.state:<27}'
                  f' {one.origin:12.6f} -> {one.target:12.6f}')
        for line in lines:
            print(f'  {line}')
        return
    console.print(Text(f'{head}: ', style='bold').append(
        verdict, style='green' if trial.success else 'red'))
    table = Table(box=None, padding=(0, 2), header_style='dim')
    table.add_column('home state')
    for name in ('begins', 'takes', 'from', 'to'):
        table.add_column(name, justify='right')
    for one in trial.stretches:
        table.add_row(Text(one.state, style=f'bold {state_colour(State(one.state))}'),
                      f'{one.begin:.3f} s', f'{one.end - one.begin:.3f} s',
                      f'{one.origin:.6f}', f'{one.target:.6f}')
    if trial.stretches:
        console.print(table)
    for line in lines:
        console.print(Text(f'  {line}'))


def _sweep_axis(
    arguments: argparse.Namespace, axis: str, parameters: AxisParameters, where: AxisLayout,
    timing: Timing, told: list[dict[str, object]],
) -> bool:
    from . import sweep_plot

    console = Console(stderr=True)
    positions = starts(parameters, where, arguments.starts)
    shown = console.is_terminal and not arguments.json
    progress: AbstractContextManager[Progress | None] = (
        Progress(console=console, transient=True) if shown else nullcontext())
    with progress as bar:
        task = bar.add_task(f'axis {axis}', total=len(positions)) if bar else None

        def done() -> None:
            if bar and task is not None:
                bar.advance(task)
        trials = list(sweep(parameters, where, transport_of(timing), positions, axis, done))
    path = arguments.plot or Path(f'{axis}_starts.png')
    title = f'{axis}: {parameters.home_type} {parameters.home_direction}'
    _written(path, lambda: sweep_plot.draw(path, trials, where, title))
    if arguments.save:
        _written(arguments.save, lambda: _save_starts(arguments.save, trials))
    if arguments.json:
        told += [_as_dict(axis, parameters, trial) for trial in trials]
        return all(trial.success for trial in trials)
    durations = [trial.course.duration for trial in trials]
    took = sum(trial.took for trial in trials)
    homed = sum(trial.success for trial in trials)
    print(f'axis {axis}: {parameters.home_type} {parameters.home_direction} from {len(trials)} '
          f'positions: {homed} homed, {len(trials) - homed} failed')
    for error in dict.fromkeys(trial.error for trial in trials if trial.error):
        failed = [trial for trial in trials if trial.error == error]
        message = failed[0].course.outcome.message if failed[0].course.outcome else ''
        print(f'  {error} from {len(failed)} positions between {failed[0].start:g} and '
              f'{failed[-1].start:g}{": " if message else ""}{message}')
    print(f'  time {min(durations):.3f} s to {max(durations):.3f} s')
    off = [abs(trial.off) for trial in trials if trial.off is not None]
    if off:
        print(f'  home off by at most {max(off):.2g}')
    print(f'  rehearsed in {took:.2f} s, {sum(durations) / took:.0f} times real time')
    print(f'  wrote {path}')
    if arguments.save:
        print(f'  wrote {arguments.save}')
    return homed == len(trials)


def _save_starts(path: Path, trials: Sequence[Trial]) -> None:
    """Save what became of each start, one line each."""
    if path.suffix != '.csv':
        raise ValueError('the table of --all-starts is saved as .csv')
    rows = ['start,time,error,home_position_raw,off']
    for trial in trials:
        outcome = trial.course.outcome
        home = repr(outcome.home_position_raw) if outcome and outcome.success else ''
        off = '' if trial.off is None else repr(trial.off)
        rows.append(f'{trial.start!r},{trial.course.duration!r},{trial.error},{home},{off}')
    path.write_text('\n'.join(rows) + '\n', encoding='utf-8')


# ------------------------------------------------------------------------------ plot and diagram


def _plot(arguments: argparse.Namespace) -> int:
    from . import plot, record

    try:
        course, title = record.load(arguments.record)
    except record.InvalidRecord as error:
        raise Failure(str(error), status=FAILED) from None
    except OSError as error:
        raise Failure(f'{arguments.record}: {error.strerror}') from None
    layout = _layout(arguments.layout)
    panels = {'all': plot.WHOLE, 'position': plot.POSITION_DIAGRAM, 'profile': plot.PROFILE}
    path = arguments.output or arguments.record.with_suffix('.png')
    where = None if layout is None else _layout_of(layout, arguments, title)
    _written(path, lambda: plot.save(
        path, course, where, title, panels[arguments.panels], arguments.unit))
    print(f'wrote {path}')
    return OK


def _layout_of(layout: LayoutFile, arguments: argparse.Namespace, title: str) -> AxisLayout:
    """Return the axis of a layout that a record is of."""
    axis = arguments.axis or title.partition(':')[0]
    if not arguments.axis and axis not in layout.layouts and len(layout.layouts) == 1:
        return next(iter(layout.layouts.values()))
    if axis not in layout.layouts:
        raise Failure(f'{arguments.layout}: no axis {axis!r} in it; say which with --axis: '
                      f'{", ".join(layout.layouts)}')
    return layout.layouts[axis]


def _diagram(arguments: argparse.Namespace) -> int:
    from .diagram import mermaid
    from .diagram_svg import svg

    procedure, path = PROCEDURES[HomeType(arguments.type)], arguments.output
    kind = arguments.format or ('svg' if path and path.suffix == '.svg' else 'mermaid')
    text = svg(procedure) if kind == 'svg' else mermaid(procedure)
    if path is None:
        print(text, end='')
    else:
        _written(path, lambda: path.write_text(text, encoding='utf-8') and None)
        print(f'wrote {path}')
    return OK
