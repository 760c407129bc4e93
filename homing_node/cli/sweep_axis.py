# SPDX-License-Identifier: Apache-2.0
"""`homing run --all-starts`: runs from everywhere along the travel of an axis."""

import argparse
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..rehearsal.gantry import Followers
from ..rehearsal.sweep import Trial, starts, sweep, transport_of
from .common import written

#: How many start positions, where the user does not say it.
STARTS = 101


def sweep_axis(
    arguments: argparse.Namespace,
    axis: str,
    parameters: AxisParameters,
    where: AxisLayout,
    timing: Timing,
    followers: Followers,
) -> list[Trial]:
    """Run from everywhere along the travel; draw and print the results."""
    from ..figures import sweep_plot

    console = Console(stderr=True)
    positions = starts(parameters, where, arguments.starts or STARTS)
    shown = console.is_terminal and not arguments.json
    progress: AbstractContextManager[Progress | None] = (
        Progress(console=console, transient=True) if shown else nullcontext()
    )
    with progress as bar:
        task = bar.add_task(f'axis {axis}', total=len(positions)) if bar else None

        def done() -> None:
            if bar and task is not None:
                bar.advance(task)

        transport = transport_of(timing)
        trials = list(sweep(parameters, where, transport, positions, axis, done, followers))
    path = arguments.plot or Path(f'{axis}_starts.png')
    unit = arguments.unit or str(parameters.unit)
    title = f'{axis}: {parameters.home_type} {parameters.home_direction}, time from each start'
    written(path, lambda: sweep_plot.draw(path, trials, where, title, unit))
    if arguments.save:
        written(arguments.save, lambda: _save_starts(arguments.save, trials))
    if not arguments.json:
        _show(axis, parameters, trials, unit)
        print(f'  wrote {path}')
        if arguments.save:
            print(f'  wrote {arguments.save}')
    return trials


def _show(axis: str, parameters: AxisParameters, trials: Sequence[Trial], unit: str) -> None:
    durations = [trial.course.duration for trial in trials]
    took = sum(trial.took for trial in trials)
    homed = sum(trial.success for trial in trials)
    print(
        f'axis {axis}: {parameters.home_type} {parameters.home_direction} from {len(trials)} '
        f'positions: {homed} homed, {len(trials) - homed} failed'
    )
    for error in dict.fromkeys(trial.error for trial in trials if trial.error):
        failed = [trial for trial in trials if trial.error == error]
        message = failed[0].course.outcome.message if failed[0].course.outcome else ''
        if failed[0].wrong_home:
            worst = max(abs(trial.off or 0.0) for trial in failed)
            message = f'off by up to {worst:.2g} {unit}, more than the uncertainty'
        print(
            f'  {error} from {len(failed)} positions between {failed[0].start:g} {unit} and '
            f'{failed[-1].start:g} {unit}{": " if message else ""}{message}'
        )
    print(f'  time {min(durations):.3f} s to {max(durations):.3f} s')
    off = [abs(trial.off) for trial in trials if trial.off is not None]
    if off:
        print(f'  home off by at most {max(off):.2g} {unit}')
    print(f'  rehearsed in {took:.2f} s, {sum(durations) / took:.0f} times real time')


def _save_starts(path: Path, trials: Sequence[Trial]) -> None:
    """Save the result of each start, one line each."""
    rows = ['start,time,error,home_position_raw,off']
    for trial in trials:
        outcome = trial.course.outcome
        home = repr(outcome.home_position_raw) if outcome and outcome.success else ''
        off = '' if trial.off is None else repr(trial.off)
        rows.append(f'{trial.start!r},{trial.course.duration!r},{trial.error},{home},{off}')
    path.write_text('\n'.join(rows) + '\n', encoding='utf-8')
