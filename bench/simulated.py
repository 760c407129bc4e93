# SPDX-License-Identifier: Apache-2.0
"""Simulated runs against real time."""

from collections.abc import Iterator
from functools import partial
from statistics import median

from figures import Figure, alternately, seconds
from homing_time import LAYOUT, parameters
from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig

from homing_node.plant.simulated_axis import SimulatedAxis
from homing_node.rehearsal.link import PLANT_STEP, Transport
from homing_node.rehearsal.run import Rehearsal

GOAL = 100.0


def run(rate: float) -> float:
    """Home the axis of scenario A once; return simulated seconds per second."""
    rehearsal = Rehearsal(parameters('HSHS'), LAYOUT, Transport(update_rate=rate))
    taken = seconds(rehearsal.home)
    assert rehearsal.axis.homed
    return rehearsal.time / taken


def bare(rate: float, simulated: float) -> float:
    """Let ruckig drive the plant to and fro, without any homing."""
    plant = SimulatedAxis(LAYOUT)
    period, steps = 1.0 / rate, round(1.0 / (rate * PLANT_STEP))
    otg, given, found = Ruckig(1, period), InputParameter(1), OutputParameter(1)
    given.control_interface = ControlInterface.Velocity
    given.max_acceleration, given.max_jerk = [1.0], [100.0]

    def drive() -> None:
        for cycle in range(round(simulated * rate)):
            for _ in range(steps):
                plant.step(PLANT_STEP)
            if cycle % round(rate) == 0:
                given.target_velocity = [-0.05 if cycle // round(rate) % 2 else 0.05]
            otg.update(given, found)
            found.pass_to_input(given)
            plant.follow(found.new_position[0], over=period)

    return simulated / seconds(drive)


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield how many seconds are simulated in one."""
    for rate in (1000.0, 250.0):
        ours, alone = alternately(
            2 if quick else 15, partial(run, rate), partial(bare, rate, 0.2 if quick else 2.5)
        )
        wanted = (f'≥ {GOAL:g}', median(ours) >= GOAL) if rate == 1000.0 else ('', None)
        yield Figure(
            f'core and plant (1 kHz), cycle of {rate:g} Hz, against ruckig and plant',
            's per s',
            ours,
            alone,
            *wanted,
        )
