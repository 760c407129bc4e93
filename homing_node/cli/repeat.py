# SPDX-License-Identifier: Apache-2.0
"""`homing repeat`: homes an axis several times, and compares the homes."""

import argparse
import json
from collections.abc import Sequence
from statistics import fmean, pstdev
from typing import NamedTuple

from ..parameters.units import Unit
from .common import FAILED, OK, Failure, add_node, count
from .live import STATUS, connected

TEXT = """\
Homes an axis several times through a running homing_node, and tells how far the homes spread, how
they drift, and whether the uncertainty that the node promises holds. The axis moves. Needs ROS.
"""

EXAMPLES = f"""\
examples:
  homing repeat x
  homing repeat x --runs 30 --node /cell_2/homing_node

{STATUS}"""

FAILURE = 'a run failed, or the homes spread further than their uncertainty'


class Homes(NamedTuple):
    """Homes of one axis: raw positions, and how far each may be off; m or rad."""

    positions: Sequence[float]
    uncertainties: Sequence[float]

    @property
    def range(self) -> float:
        return max(self.positions) - min(self.positions)

    @property
    def deviation(self) -> float:
        return pstdev(self.positions)

    @property
    def drift(self) -> float:
        """The change from run to run: the slope of the line that fits best."""
        middle = 0.5 * (len(self.positions) - 1)
        mean = fmean(self.positions)
        square = sum((i - middle) ** 2 for i in range(len(self.positions)))
        product = sum((i - middle) * (p - mean) for i, p in enumerate(self.positions))
        return product / square if square else 0.0

    @property
    def promised(self) -> float:
        """How far two homes may be apart by their uncertainties."""
        return sum(sorted(self.uncertainties)[-2:])

    @property
    def kept(self) -> bool:
        return self.range <= self.promised

    def lines(self, unit: Unit) -> list[str]:
        """Return the report."""
        verdict = 'holds' if self.kept else 'does not hold'
        return [
            f'{len(self.positions)} homes, on average at {fmean(self.positions):.6f} {unit} (raw)',
            f'spread: {unit.length(self.range)} in all, {unit.length(self.deviation)} standard '
            'deviation',
            f'drift: {unit.length(self.drift, sign=True)} from run to run',
            f'uncertainty: {unit.length(max(self.uncertainties))}, so that two homes are within '
            f'{unit.length(self.promised)}: that {verdict}',
        ]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('axis', metavar='AXIS', help='the name of the axis')
    parser.add_argument(
        '--runs', metavar='N', type=count, default=10, help='how often (default: %(default)s)'
    )
    add_node(parser)
    parser.add_argument(
        '--unit', choices=[str(one) for one in Unit], default='m', help='the unit of the axis'
    )
    parser.add_argument('--json', action='store_true', help='print the result as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    positions: list[float] = []
    uncertainties: list[float] = []
    with connected(arguments) as client:
        for number in range(1, arguments.runs + 1):
            answer = client.home(arguments.axis, force=True)  # a coordinator would skip it
            if not answer:
                raise Failure(f'run {number}: {answer.message}', status=FAILED)
            (state,) = answer.states
            positions.append(state.home_position_raw)
            uncertainties.append(state.uncertainty)
            if not arguments.json:
                print(f'run {number}: {answer.message}', flush=True)
    homes = Homes(positions, uncertainties)
    if arguments.json:
        print(
            json.dumps(
                {
                    'axis': arguments.axis,
                    'ok': homes.kept,
                    'home_position_raw': positions,
                    'uncertainty': uncertainties,
                    'range': homes.range,
                    'deviation': homes.deviation,
                    'drift': homes.drift,
                    'promised': homes.promised,
                },
                indent=2,
            )
        )
    else:
        print('\n'.join(homes.lines(Unit(arguments.unit))))
    return OK if homes.kept else FAILED
