# SPDX-License-Identifier: Apache-2.0
"""What the verbs share: exit statuses, files, numbers."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..check import Finding, Severity
from ..parameters import yaml_file
from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..parameters.definition import InvalidParameters
from ..plant import layout_file
from ..plant.layout_file import InvalidLayout, LayoutFile
from ..plant.timing import Timing

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

COLOURS = {Severity.error: 'bold red', Severity.warning: 'yellow', Severity.info: 'cyan'}


class Failure(Exception):
    """The end of a verb: lines for the user, and the exit status."""

    def __init__(self, *lines: str, status: int = USAGE) -> None:
        self.lines, self.status = lines, status


# --------------------------------------------------------------------------------- the arguments


def add_configuration(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'config', metavar='CONFIG', type=Path, help='parameter file of homing_node (YAML)'
    )
    parser.add_argument(
        '--node',
        metavar='NAME',
        default=yaml_file.NODE,
        help='the node that the parameters are for (default: %(default)s)',
    )


def add_axes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('axes', metavar='AXIS', nargs='*', help='the names of axes (default: all)')


def add_node(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        '--node',
        metavar='NAME',
        default=yaml_file.NODE,
        help='the full name of the homing node, with its namespace (default: %(default)s)',
    )


def add_timing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        '--feedback-rate',
        metavar='HZ',
        type=positive,
        help='how often joint_states come (default: as the layout file says)',
    )
    parser.add_argument(
        '--latency',
        metavar='S',
        type=not_negative,
        help="from a switch's edge until the setpoint that answers it takes effect "
        f"(default: the layout file's dead_time, else {Timing().latency:g} s)",
    )


def add_unit(parser: argparse.ArgumentParser, otherwise: str) -> None:
    parser.add_argument(
        '--unit',
        choices=('m', 'rad'),
        help=f'of positions: a linear or a rotary axis (default: {otherwise})',
    )


def positive(text: str) -> float:
    number = float(text)
    if not 0.0 < number < float('inf'):
        raise argparse.ArgumentTypeError(f'{text} is not a number > 0')
    return number


def not_negative(text: str) -> float:
    number = float(text)
    if not 0.0 <= number < float('inf'):
        raise argparse.ArgumentTypeError(f'{text} is not a number >= 0')
    return number


def count(text: str) -> int:
    number = int(text)
    if not 2 <= number <= 100_000:
        raise argparse.ArgumentTypeError(f'{text} is not a number from 2 to 100000')
    return number


# ------------------------------------------------------------------------------------- the files


def configuration_of(arguments: argparse.Namespace) -> Configuration:
    """Read and check CONFIG.

    Raises:
        Failure: The file is a layout, or cannot be read.
        InvalidParameters: The node could not use it.
    """
    path: Path = arguments.config
    try:
        return yaml_file.load(path, arguments.node)
    except InvalidParameters as error:
        if layout_file.is_layout(path):
            raise Failure(f'{path}: this looks like a layout: use --layout {path}') from None
        if not path.is_file():
            raise Failure(*error.faults) from None
        raise


def layout_from(path: Path | None) -> LayoutFile | None:
    """Read a layout; None: none is given."""
    if path is None:
        return None
    try:
        return layout_file.load(path)
    except InvalidLayout as error:
        if yaml_file.is_configuration(path):
            raise Failure(
                f'{path}: this looks like the parameters of homing_node, not like a layout: '
                'give it as CONFIG, without --layout'
            ) from None
        raise Failure(*error.faults) from None


def timing_of(arguments: argparse.Namespace, layout: LayoutFile | None) -> Timing:
    rate, latency = arguments.feedback_rate, arguments.latency
    if layout is not None:
        rate = layout.feedback_rate if rate is None else rate
        latency = layout.dead_time if latency is None else latency
    return Timing(
        feedback_rate=rate,
        latency=Timing().latency if latency is None else latency,
        accuracy=getattr(arguments, 'accuracy', None),
    )


def only(axis: str | None, axes: Mapping[str, AxisParameters]) -> dict[str, AxisParameters]:
    if axis is None:
        return dict(axes)
    if axis not in axes:
        raise Failure(f'--axis: {axis!r} is none of the axes {", ".join(axes)}')
    return {axis: axes[axis]}


def written(path: Path, write: Callable[[], None]) -> None:
    """Write a file; raise Failure with the path where it cannot be written."""
    try:
        write()
    except OSError as error:
        raise Failure(f'{path}: {error.strerror or error}') from None
    except ValueError as error:
        raise Failure(f'{path}: {str(error).removeprefix(f"{path}: ")}') from None


def console() -> Console:
    return Console(highlight=False, soft_wrap=False)


def show_findings(console: Console, found: Sequence[Finding], name: str) -> None:
    """Print findings: tables on a terminal, otherwise a line each."""
    counts = {severity: sum(one.severity is severity for one in found) for severity in Severity}
    words = [
        f'{count} {severity}{"s" if count > 1 and severity is not Severity.info else ""}'
        for severity, count in counts.items()
        if count
    ]
    summary = f'{name}: {", ".join(words) or "nothing found"}'
    if not console.is_terminal:
        for one in found:
            where = f'axis {one.axis}: ' if one.axis else ''
            remedy = f' [{one.remedy}]' if one.remedy else ''
            print(f'{one.severity}: {where}{one.check}: {one.what}; {one.why}{remedy}')
        print(summary)
        return
    for axis in dict.fromkeys(one.axis for one in found):
        table = Table(
            title=f'axis {axis}' if axis else None,
            title_justify='left',
            title_style='bold',
            show_header=False,
            box=None,
            padding=(0, 2, 1, 0),
        )
        table.add_column(no_wrap=True)
        table.add_column(overflow='fold')
        for one in found:
            if one.axis == axis:
                text = Text(one.what)
                text.append(f'\n{one.why}', style='dim')
                if one.remedy:
                    text.append('\n→ ', style='green').append(one.remedy, style='bold green')
                table.add_row(
                    Text(f'{one.severity}\n{one.check}', style=COLOURS[one.severity]), text
                )
        console.print(table)
    style = 'bold red' if counts[Severity.error] else 'bold green'
    console.print(Text(summary, style=style))
