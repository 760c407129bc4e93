# SPDX-License-Identifier: Apache-2.0
"""What `homing run` says of a run: for people, and as JSON."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..figures.palette import state_colour
from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.states import State
from ..rehearsal.sweep import Trial, transport_of


def as_dict(
    axis: str, parameters: AxisParameters, where: AxisLayout, trial: Trial, timing: Timing
) -> dict[str, object]:
    """Return a run as plain values."""
    outcome, transport = trial.course.outcome, transport_of(timing)
    return {
        'axis': axis,
        'home_type': str(parameters.home_type),
        'start': trial.start,
        'success': trial.success,
        'error': trial.error,
        'message': outcome.message if outcome else '',
        'time': trial.course.duration,
        'update_rate': transport.update_rate,
        'feedback_rate': transport.feedback_rate,
        'switch_rate': where.switch_rate,
        'home_position_raw': outcome.home_position_raw if outcome and outcome.success else None,
        'true_home': trial.true_home,
        'off': trial.off,
        'uncertainty': outcome.uncertainty if outcome and outcome.success else None,
        'wrong_home': trial.wrong_home,
        'states': [stretch._asdict() for stretch in trial.stretches],
        **_gantry_as_dict(trial),
    }


def _gantry_as_dict(trial: Trial) -> dict[str, object]:
    """Return what a run of a gantry has besides."""
    course = trial.course
    if not course.followers or course.outcome is None:
        return {}
    return {
        'members': [member._asdict() for member in course.outcome.members],
        'out_of_square': dict(trial.askew),
        'largest_skew': course.largest_skew,
        'largest_force': course.largest_force,
    }


def show_run(
    console: Console,
    axis: str,
    parameters: AxisParameters,
    trial: Trial,
    unit: str,
    files: Sequence[Path],
) -> None:
    """Print a run."""
    outcome = trial.course.outcome
    assert outcome is not None
    lines = []
    if trial.hits is not None:
        lines.append(f'the axis ran into the hard stop at {trial.hits:g} {unit}')
    if trial.wrong_home and trial.off is not None:
        lines.append(
            f'wrong home: it is {abs(trial.off):.2g} {unit} off the true one, more than its '
            f'uncertainty of {outcome.uncertainty:.2g} {unit}'
        )
    if outcome.success:
        known = (
            ''
            if trial.off is None or trial.true_home is None
            else f'; true {trial.true_home:.6f} {unit}, off by {abs(trial.off):.2g} {unit}'
        )
        lines += [
            f'home position {outcome.home_position_raw:.6f} {unit} (raw){known}, known to within '
            f'{outcome.uncertainty:.2g} {unit}',
            f'reads {parameters.home_position:g} {unit} at '
            f'{outcome.home_offset + parameters.home_position:.6f} {unit} (raw)',
        ]
    else:
        lines.append(f'{outcome.error}: {outcome.message}')
    lines += _gantry_lines(trial, unit)
    seconds = f'{trial.course.duration:.3f} s'
    verdict = f'homed in {seconds}' if trial.success else f'failed after {seconds}'
    head = (
        f'axis {axis}: {parameters.home_type} {parameters.home_direction} '
        f'from {trial.start:g} {unit}'
    )
    lines.append(f'rehearsed in {trial.took:.3f} s, {trial.speed:.0f} times real time')
    lines += [f'wrote {path}' for path in files]
    if not console.is_terminal:
        print(f'{head}: {verdict}')
        for one in trial.stretches:
            print(
                f'  {one.begin:8.3f} s  {one.end - one.begin:8.3f} s  {one.state:<27}'
                f' {one.origin:12.6f} -> {one.target:12.6f}'
            )
        for line in lines:
            print(f'  {line}')
        return
    console.print(
        Text(f'{head}: ', style='bold').append(verdict, style='green' if trial.success else 'red')
    )
    table = Table(box=None, padding=(0, 2), header_style='dim')
    table.add_column('home state')
    for name in ('begins', 'takes', 'from', 'to'):
        table.add_column(name, justify='right')
    for one in trial.stretches:
        table.add_row(
            Text(one.state, style=f'bold {state_colour(State(one.state))}'),
            f'{one.begin:.3f} s',
            f'{one.end - one.begin:.3f} s',
            f'{one.origin:.6f}',
            f'{one.target:.6f}',
        )
    if trial.stretches:
        console.print(table)
    for line in lines:
        console.print(Text(f'  {line}'))


def _gantry_lines(trial: Trial, unit: str) -> Iterator[str]:
    """Yield what a run of a gantry comes to: how square, how skewed, which forces."""
    course = trial.course
    if not course.followers:
        return
    members = course.outcome.members if course.outcome else ()
    for (name, off), member in zip(trial.askew.items(), members[1:], strict=False):
        if course.outcome and course.outcome.success:
            yield (
                f'{name} is {member.squareness:.2g} {unit} out of square, to within '
                f'{member.uncertainty:.2g} {unit}; true {-off + 0.0:.2g} {unit}'
            )
    force = course.largest_force
    bore = f', a spring bore up to {force:.3g} N' if force else ''
    yield f'the sides were up to {course.largest_skew:.3g} {unit} skewed in the run{bore}'
