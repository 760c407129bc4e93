# SPDX-License-Identifier: Apache-2.0
"""A jog: one axis moves by a distance, with every bound and stop of a homing run.

The machine runs it as it runs a home type: with a table (procedures/jog.py), and with parameters
that are those of the axis but for the velocity. Distances are in m or rad, times in s.
"""

import dataclasses
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from ..parameters.axis import LONGEST_MOVE, AxisParameters
from ..procedures.jog import JOGS
from ..procedures.motions import Way
from ..procedures.procedure import Procedure
from .machine import Machine
from .outcome import Met
from .signals import FINEST

#: A jog with a deadman stops so long after the last true, s.
DEADMAN_TIME = 0.3


class Jog(NamedTuple):
    """What is asked for.

    Attributes:
        distance: how far to go, with its sign, raw, m or rad.
        velocity: how fast, m/s or rad/s.
        deadman: whether the axis stops when `Axis.deadman` is no longer told that it is held.
    """

    distance: float
    velocity: float
    deadman: bool = False


def fault_of(jog: Jog, parameters: AxisParameters) -> str:
    """Return why an axis cannot jog so, '' if it can."""
    p, unit = parameters, parameters.unit
    fastest = p.homing_velocity_fast
    fault = ''
    if not isfinite(jog.distance) or jog.distance == 0.0:
        fault = f'distance: {jog.distance:g} must be a number other than 0'
    elif abs(jog.distance) > p.travel:
        fault = f'distance: {jog.distance:g} m must be within +-travel, {p.travel:g} m'
    elif not (isfinite(jog.velocity) and jog.velocity > 0.0):
        fault = f'velocity: {jog.velocity:g} must be > 0 m/s'
    elif jog.velocity > fastest:
        fault = f'velocity: {jog.velocity:g} m/s must be <= homing_velocity_fast, {fastest:g} m/s'
    elif abs(jog.distance) / jog.velocity > LONGEST_MOVE:
        least = abs(jog.distance) / LONGEST_MOVE
        fault = (
            f'velocity: {jog.velocity:g} m/s must be >= {least:.3g} m/s, so that {jog.distance:g} '
            f'm take no longer than {LONGEST_MOVE:g} s'
        )
    return unit.in_message(fault)


@dataclass(frozen=True, kw_only=True, slots=True)
class JogParameters(AxisParameters):
    """The parameters of an axis while it jogs.

    Attributes:
        way: the way of the jog.
    """

    way: Way

    @property
    def procedure(self) -> Procedure:
        return JOGS[self.way]


def jog_parameters(parameters: AxisParameters, jog: Jog) -> JogParameters:
    """Return the parameters of a jog: its velocity is the fast one, and the slow one at most.

    Every limit acts both ways, because whoever jogs may have swapped the two. The time bound is
    the computed one: `timeout` is for a homing run.
    """
    p = parameters
    values = {one.name: getattr(p, one.name) for one in dataclasses.fields(AxisParameters)}
    values |= {
        'homing_velocity_fast': jog.velocity,
        'homing_velocity_slow': min(jog.velocity, p.homing_velocity_slow),
        'all_ls_during_homing': True,
        'open_loop_homing': False,
        'pause_mode': False,
        'timeout': 0.0,
        'repeat': 1,
    }
    toward = jog.distance * p.home_direction.sign > 0.0
    return JogParameters(**values, way=Way.TOWARD if toward else Way.AWAY)


def met(machine: Machine, finest: float) -> tuple[Met, ...]:
    """Return what a jog has met on its way.

    Args:
        machine: the jog, which has ended.
        finest: the smallest uncertainty of a place that is no edge of a switch, m or rad.
    """
    sign = machine.parameters.home_direction.sign
    edges = [
        Met(
            edge.time,
            edge.input,
            edge.rises,
            sign * edge.position,
            edge.uncertainty,
            sign * edge.way * edge.speed,
        )
        for edge in machine.seen.edges
    ]
    pulses = [
        Met(
            one.time,
            one.input,
            True,
            sign * one.position,
            max(finest, FINEST),
            sign * one.velocity,
        )
        for one in machine.seen.latches
    ]
    return tuple(sorted([*edges, *pulses], key=lambda one: one.time))
