# SPDX-License-Identifier: Apache-2.0
"""Accuracy: error of home against the true edge, and what is said of it.

An axis crosses its home switch at constant velocity while messages are late; the counterpart is
LinuxCNC's law: it takes the position of the servo cycle that sees the switch, an error that is
uniform in 0 ... v T with T = 1 ms. Then random runs: does the reported uncertainty cover the
error? Draws accuracy.png.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from math import floor, log10
from pathlib import Path
from statistics import median
from typing import NamedTuple

from figures import Figure, nth
from matplotlib import figure as plots
from matplotlib.backends.backend_agg import FigureCanvasAgg

from homing_node.figures.palette import BLUE, GREEN, INK, VERMILLION
from homing_node.parameters.axis import axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.run import Rehearsal

PICTURE = Path(__file__).resolve().parent.parent / 'accuracy.png'
EDGE = 0.1  # m; varied by up to 1 mm
FLAG = 0.01
SPEEDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)  # m/s
DELAYS: Mapping[str, Mapping[str, float]] = {
    'no delay': {},
    '5 ms': {'feedback_delay': 0.005, 'switch_delay': 0.005},
    '20 ms': {'feedback_delay': 0.020, 'switch_delay': 0.020},
    '0–20 ms jittering': {'jitter': 0.020},
}
RATES = {1000.0: BLUE, 500.0: GREEN, 100.0: VERMILLION}  # of the feedback, Hz
GOALS = {0.005: 0.3, 0.05: 5.0}  # m/s -> µm, at 500 Hz
LINUXCNC_CYCLE = 0.001  # s
MICRO = 1e6
#: Less than this is rounding, µm.
NOTHING = 1e-6


class Found(NamedTuple):
    """What a run said, µm: the error of its home and the uncertainty that it reported."""

    error: float
    uncertainty: float


def counted(position: float, resolution: float) -> float:
    """Return a position as an encoder with a resolution, m, shows it; 0: exactly."""
    return (floor(position / resolution) + 0.5) * resolution if resolution else position


class Counting(Rehearsal):
    """A rehearsal whose feedback comes from an encoder with a resolution, m."""

    resolution = 0.0

    def _send_feedback(self, time: float, position: float) -> None:
        super()._send_feedback(time, counted(position, self.resolution))


def home(
    random: random.Random,
    speed: float,
    transport: Transport,
    home_type: str = 'HS',
    run_up: float = 0.0,
    lag: float = 0.0,
    resolution: float = 0.0,
) -> Found:
    """Home once onto a switch whose edge lies anywhere; ``run_up`` in m, 0: enough."""
    edge = EDGE + random.uniform(-1e-3, 1e-3)
    enough = speed**2 / 5.0 + speed * (0.03 + lag * 10.0 + random.uniform(0.0, 0.05))
    layout = AxisLayout(
        (0.0, 0.4),
        {'home_switch': SwitchLayout(edge, edge + FLAG)},
        lag=lag,
        start=counted(edge - (run_up or enough), resolution),
    )
    accelerations = {
        f'{pace}_{kind}': 5.0
        for kind in ('acc', 'dec')
        for pace in ('homing_velocity_fast', 'homing_velocity_slow', 'home_shift')
    }
    parameters = axis_parameters(
        {
            'home_type': home_type,
            'travel': 0.4,
            'switches': ['home_switch'],
            'max_jerk': 500.0,
            'homing_velocity_fast': speed,
            'homing_velocity_slow': speed,
            'home_shift_velocity': 0.2,
            'following_error': 0.05,
            'edge_tolerance': 0.01,
            'wrong_direction_distance': 0.01,
            'switch_stamp_error': transport.stamp_error,
            **accelerations,
        }
    )
    rehearsal = Counting(parameters, layout, transport)
    rehearsal.resolution = resolution
    outcome = rehearsal.home().outcome
    assert outcome is not None and outcome.success, outcome
    return Found(abs(outcome.home_position_raw - edge) * MICRO, outcome.uncertainty * MICRO)


def crossings(runs: int) -> dict[tuple[float, str, float], list[float]]:
    """Return the errors, µm, by speed, delay and rate of the feedback."""
    chance = random.Random(1)
    return {
        (speed, name, rate): [
            home(
                chance, speed, Transport(feedback_rate=rate, seed=chance.getrandbits(30), **delay)
            ).error
            for _ in range(runs)
        ]
        for speed in SPEEDS
        for name, delay in DELAYS.items()
        for rate in RATES
    }


def random_runs(runs: int) -> list[Found]:
    """Home with everything at random: also while the axis accelerates, lags, counts coarsely.

    The switch's stamps are late by up to what its driver says of itself.
    """
    chance = random.Random(2)
    found = []
    for _ in range(runs):
        speed = 10 ** chance.uniform(-3.0, log10(0.2))
        run_up = 0.0 if chance.random() < 0.5 else chance.uniform(0.05, 1.0) * speed**2 / 5.0
        transport = Transport(
            feedback_rate=chance.choice((100.0, 250.0, 500.0, 1000.0)),
            feedback_delay=chance.uniform(0.0, 0.02),
            switch_delay=chance.uniform(0.0, 0.02),
            jitter=chance.choice((0.0, 0.005, 0.02)),
            seed=chance.getrandbits(30),
            stamp_error=chance.choice((1e-5, 1e-4, 1e-3)),
        )
        found.append(
            home(
                chance,
                speed,
                transport,
                chance.choice(('HS', 'HSHS')),
                run_up,
                lag=chance.choice((0.0, chance.uniform(0.0, 0.02))),
                resolution=chance.choice((0.0, 10 ** chance.uniform(-8.0, -5.0))),
            )
        )
    return found


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the errors and the quality of the reported uncertainty; draw the picture."""
    errors = crossings(1 if quick else 30)
    chance = random.Random(3)

    def linuxcnc(speed: float, count: int) -> list[float]:
        return [chance.uniform(0.0, speed * LINUXCNC_CYCLE * MICRO) for _ in range(count)]

    for speed, most in GOALS.items():
        for name in DELAYS:
            found = errors[speed, name, 500.0]
            worst = max(found)
            yield Figure(
                f'{speed * 1e3:g} mm/s, {name}, 500 Hz, against LinuxCNC',
                'µm',
                found,
                linuxcnc(speed, len(found)),
                f'all ≤ {most:g} µm',
                worst <= most,
            )
    for speed in SPEEDS:
        found = [error for key, each in errors.items() if key[0] == speed for error in each]
        yield Figure(
            f'{speed * 1e3:g} mm/s, the worst of all delays and rates',
            'µm',
            [max(found)],
            [speed * LINUXCNC_CYCLE * MICRO],
        )
    yield from _of_uncertainty(random_runs(20 if quick else 1000))
    if not quick:
        draw(errors)


def _of_uncertainty(found: Sequence[Found]) -> Iterator[Figure]:
    covered = 100.0 * sum(one.error <= one.uncertainty + NOTHING for one in found) / len(found)
    yield Figure(f'{len(found)} random runs: error', 'µm', [one.error for one in found])
    yield Figure('reported uncertainty', 'µm', [one.uncertainty for one in found])
    yield Figure(
        'errors that the uncertainty covers', '%', [covered], (), '≥ 99.9 %', covered >= 99.9
    )
    ratios = [one.uncertainty / max(one.error, NOTHING) for one in found]
    middle = median(ratios)
    yield Figure('uncertainty / error, median', '', [middle], (), '≤ 6', middle <= 6.0)
    some = [one for one in found if one.error > 0.01]
    yield Figure(
        f'the same of the {len(some)} runs with an error above 0.01 µm',
        '',
        [median(one.uncertainty / one.error for one in some)] if some else [],
    )
    worst = [one.error / max(one.uncertainty, NOTHING) for one in found]
    yield Figure('error / uncertainty, p99', '', [nth(worst, 0.99)])


def draw(errors: Mapping[tuple[float, str, float], Sequence[float]]) -> None:
    """Draw the worst error over the speed, a panel for each delay."""
    sheet = plots.Figure(figsize=(7.9, 5.2), layout='constrained')
    FigureCanvasAgg(sheet)
    panels = sheet.subplots(2, 2, sharex=True, sharey=True)
    speeds = [speed * 1e3 for speed in SPEEDS]
    for panel, name in zip(panels.flat, DELAYS, strict=True):
        for rate, colour in RATES.items():
            worst = [max(max(errors[speed, name, rate]), NOTHING) for speed in SPEEDS]
            panel.loglog(
                speeds,
                worst,
                'o-',
                markersize=3,
                linewidth=1.2,
                color=colour,
                label=f'feedback at {rate:g} Hz',
            )
        panel.loglog(
            speeds,
            [speed * LINUXCNC_CYCLE * MICRO for speed in SPEEDS],
            '--',
            color=INK,
            linewidth=1,
            label='LinuxCNC: v · 1 ms',
        )
        panel.plot(
            [speed * 1e3 for speed in GOALS],
            list(GOALS.values()),
            'v',
            color=INK,
            markersize=5,
            label='goal',
        )
        panel.set_title(f'messages: {name}', fontsize=9)
        panel.grid(True, which='major', linewidth=0.4)
        panel.tick_params(labelsize=8)
    panels[0, 0].legend(fontsize=7.5)
    sheet.supxlabel('speed at the edge, mm/s', fontsize=9)
    sheet.supylabel('worst error of home, µm', fontsize=9)
    sheet.savefig(PICTURE, dpi=150, metadata={'Software': None})
