# SPDX-License-Identifier: Apache-2.0
"""A short, quick axis of every home type, and what to say about its runs.

The axis homes toward +1 in the *toward* frame; :func:`rehearsal` mirrors all of it for the other
direction. It is 100 mm long, from 0 to 0.1 m.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import wraps
from inspect import signature
from typing import Any
from zlib import crc32

import pytest

from homing_node.course import Course, Happening
from homing_node.parameters.axis import AxisParameters, axis_parameters
from homing_node.plant.carriage import _Switch
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.procedures.states import Error, HomeType, Input, LimitPair, State
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.link import DIRECT, Transport
from homing_node.rehearsal.run import Rehearsal

TYPES = tuple(HomeType)
HS_OFF_TYPES = (*TYPES[5:8], HomeType.HSOffReverse)
HS_ON_TYPES = (*TYPES[:5], HomeType.HSReverse)
REVERSING = (*HS_ON_TYPES, *HS_OFF_TYPES)
LIMIT_TYPES = (*TYPES[8:14], *TYPES[23:29])
HARDWARE_LIMIT_TYPES = tuple(t for t in LIMIT_TYPES if t.startswith('LS'))
NEAR_LIMIT_TYPES = tuple(t for t in LIMIT_TYPES if t.startswith('Near'))
EXTERNAL_LIMIT_TYPES = tuple(t for t in LIMIT_TYPES if t.startswith('External'))
INDEX_TYPES = tuple(t for t in TYPES if t.endswith('ZPulse'))
#: Those that home on an edge where a switch falls, going away.
RELEASE_TYPES = (HomeType.HSReverse, *TYPES[23:26])
END_TYPES = TYPES[17:21]
DIRECTIONS = (1, -1)

TRAVEL = 0.1
PITCH = 0.01
OFFSET = 0.0033  # pulses at 3.3, 13.3, ... mm
PROBE = 0.0655
HOME = SwitchLayout(0.060, 0.066)
BEHIND = SwitchLayout(-1.0, 0.002)
AHEAD = SwitchLayout(0.090, 1.0)
NEAR = SwitchLayout(0.080, 1.0)
EXTERNAL = SwitchLayout(0.085, 1.0)
END_HOME = SwitchLayout(0.070, 1.0)  # where the mechanical end is beyond the home switch
END = 0.098

HS = Input.HOME_SWITCH.value
LIMIT_AHEAD = Input.POSITIVE_LIMIT_SWITCH.value
LIMIT_BEHIND = Input.NEGATIVE_LIMIT_SWITCH.value
NEAR_AHEAD = Input.NEAR_POSITIVE_LIMIT_SWITCH.value
NEAR_BEHIND = Input.NEAR_NEGATIVE_LIMIT_SWITCH.value
EXTERNAL_AHEAD = Input.EXTERNAL_POSITIVE_LIMIT_SWITCH.value
EXTERNAL_BEHIND = Input.EXTERNAL_NEGATIVE_LIMIT_SWITCH.value

QUICK: Mapping[str, object] = {
    'travel': TRAVEL,
    'homing_velocity_fast': 0.2,
    'homing_velocity_fast_acc': 5,
    'homing_velocity_fast_dec': 5,
    'homing_velocity_slow': 0.05,
    'homing_velocity_slow_acc': 5,
    'homing_velocity_slow_dec': 5,
    'home_shift_velocity': 0.2,
    'home_shift_acc': 5,
    'home_shift_dec': 5,
    'ls_dec': 8,
    'ls_slow_dec': 4,
    'max_jerk': 500,
    'following_error': 0.02,
    'wrong_direction_distance': 0.004,
    'home_position': 0.25,
}


@dataclass(frozen=True)
class Rig:
    """Parameters and layout of an axis that homes toward +1."""

    home_type: HomeType
    values: Mapping[str, object]
    layout: AxisLayout
    transport: Transport = field(default=DIRECT)

    def but(self, transport: Transport | None = None, **changes: object) -> 'Rig':
        """Return the rig with other parameters."""
        return replace(
            self, values={**self.values, **changes}, transport=transport or self.transport
        )

    def built(self, **changes: object) -> 'Rig':
        """Return the rig with another layout."""
        return replace(self, layout=self.layout._replace(**changes))

    def switched(self, **flags: SwitchLayout | None) -> 'Rig':
        """Return the rig with other flags (None: not fitted, nor wired)."""
        fitted = {**self.layout.switches, **flags}
        kept = {name: flag for name, flag in fitted.items() if flag is not None}
        levels = {str(i) for i in Input} - {'z_pulse', 'touch_probe', 'servo_enabled'}
        wired = [i for i in self.values['switches'] if i not in levels] + list(kept)
        return self.built(switches=kept).but(switches=wired)

    def parameters(self, direction: int = 1) -> AxisParameters:
        values = dict(self.values)
        if direction < 0:
            values = {_other_side(name): value for name, value in values.items()}
            values['switches'] = [_other_side(str(name)) for name in values['switches']]
            values['home_direction'] = 'Negative'
        return axis_parameters(values)

    def rehearsal(self, direction: int = 1, start: float | None = None) -> Rehearsal:
        layout = self.layout if start is None else self.layout._replace(start=start)
        if direction < 0:
            layout = mirrored(layout)
        return Rehearsal(self.parameters(direction), layout, self.transport)

    def home(self, direction: int = 1, start: float | None = None) -> Course:
        return self.rehearsal(direction, start).home(limit=60.0)


def grouped(names: str, rows: Iterable[Any]) -> Callable[[Callable[..., None]], Any]:
    """Do as `parametrize` does, but in one test: for rows that take milliseconds each."""
    words, rows = names.replace(',', ' ').split(), list(rows)

    def decorate(test: Callable[..., None]) -> Any:
        @wraps(test)
        def all_rows(**given: Any) -> None:
            for row in rows:
                values = dict(zip(words, row if len(words) > 1 else (row,), strict=True))
                try:
                    test(**given, **values)
                except Exception as error:
                    raise AssertionError(f'{values}: {error}') from error

        asked = signature(test)
        others = [one for name, one in asked.parameters.items() if name not in words]
        all_rows.__signature__ = asked.replace(parameters=others)
        return all_rows

    return decorate


def thinned(rows: Iterable[Any], every: int) -> list[Any]:
    """Return rows for `parametrize`: `make test` runs each nth, `make test-long` the others."""
    return [
        pytest.param(
            *(row if isinstance(row, tuple) else (row,)),
            marks=[pytest.mark.long] if n % every else [],
        )
        for n, row in enumerate(rows)
    ]


def both_ways(test: Callable[..., None]) -> Any:
    """Run a test in one direction, and the long ones in the other: half of the tests each."""
    first = DIRECTIONS[crc32(test.__name__.encode()) % 2]
    rows = [pytest.param(first), pytest.param(-first, marks=pytest.mark.long)]
    return pytest.mark.parametrize('direction', rows)(test)


def _other_side(name: str) -> str:
    if 'positive' in name:
        return name.replace('positive', 'negative')
    return name.replace('negative', 'positive')


def rig(home_type: HomeType | str, **changes: object) -> Rig:
    """Return the axis of a home type: everything it needs fitted and wired, and both limits."""
    home_type = HomeType(home_type)
    procedure = PROCEDURES[home_type]
    ends = home_type in END_TYPES
    flags = {LIMIT_BEHIND: BEHIND}
    if not ends or home_type is HomeType.MechanicalEndDetectionLS:
        flags[LIMIT_AHEAD] = AHEAD
    if Input.HOME_SWITCH in procedure.inputs:
        flags[HS] = END_HOME if ends else HOME
    values: dict[str, object] = {**QUICK, 'home_type': str(home_type)}
    if procedure.target is LimitPair.NEAR:
        flags[NEAR_AHEAD] = NEAR
        values['near_ls_type'] = 'Dec'
    if procedure.target is LimitPair.EXTERNAL:
        flags[EXTERNAL_AHEAD] = EXTERNAL
        values['external_ls_type'] = 'Dec'
    latches = [str(i) for i in (Input.Z_PULSE, Input.TOUCH_PROBE) if i in procedure.inputs]
    if ends:
        values |= {
            'mechanical_end_detection_pos_diff': 0.004,
            'mechanical_end_detection_time': 0.02,
            'mechanical_end_detection_ignore_ls': True,
        }
    layout = AxisLayout(
        (-0.05, END if ends else 0.15),
        flags,
        index_pitch=PITCH if 'z_pulse' in latches else 0.0,
        index_offset=OFFSET,
        touch_probe=PROBE if 'touch_probe' in latches else None,
        start=0.05,
    )
    return Rig(home_type, {**values, 'switches': [*flags, *latches], **changes}, layout)


#: The home position of each type on its rig, in the toward frame.
TRUE_HOME: Mapping[HomeType, float] = {
    HomeType.HS: 0.060,
    HomeType.HSHS: 0.060,
    HomeType.HSZPulse: 0.0633,
    HomeType.HSReverseZPulse: 0.0533,
    HomeType.HSTouchProbe: PROBE,
    HomeType.HSOff: 0.066,
    HomeType.HSOffZPulse: 0.0733,
    HomeType.HSOffReverseZPulse: 0.0633,
    HomeType.LS: 0.090,
    HomeType.LSReverseZPulse: 0.0833,
    HomeType.NearLS: 0.080,
    HomeType.NearLSReverseZPulse: 0.0733,
    HomeType.ExternalLS: 0.085,
    HomeType.ExternalLSReverseZPulse: 0.0833,
    HomeType.ZPulse: 0.0533,
    HomeType.TouchProbe: PROBE,
    HomeType.MechanicalEndDetection: END,
    HomeType.MechanicalEndDetectionHS: 0.070,
    HomeType.MechanicalEndDetectionLS: 0.090,
    HomeType.MechanicalEndDetectionReverseZPulse: 0.0933,
    HomeType.HSReverse: 0.060,
    HomeType.HSOffReverse: 0.066,
    HomeType.LSOff: 0.090,
    HomeType.NearLSOff: 0.080,
    HomeType.ExternalLSOff: 0.085,
    HomeType.LSLS: 0.090,
    HomeType.NearLSNearLS: 0.080,
    HomeType.ExternalLSExternalLS: 0.085,
}


def target_of(one: Rig) -> tuple[str, float]:
    """Return the limit that a type homes on, toward +1, and where it rises."""
    target = PROCEDURES[one.home_type].target
    assert target is not None
    name = {
        LimitPair.HARDWARE: LIMIT_AHEAD,
        LimitPair.NEAR: NEAR_AHEAD,
        LimitPair.EXTERNAL: EXTERNAL_AHEAD,
    }
    return name[target], one.layout.switches[name[target]].on_from


def on_side(name: str, direction: int) -> str:
    """Return the input that has a rig's part where it homes in a direction."""
    return name if direction > 0 else _other_side(name)


def home_of(course: Course, direction: int = 1) -> float:
    """Return the home position that a run has found, in the toward frame."""
    assert course.outcome is not None
    assert course.outcome.error is Error.NoError, course.outcome.message
    return direction * course.outcome.home_position_raw


def error_of(course: Course) -> Error:
    assert course.outcome is not None
    return course.outcome.error


def path(course: Course) -> list[str]:
    """Return the home states of a run, without the Idle at its end."""
    return [state for state in course.states if state != State.Idle]


def furthest(course: Course, direction: int = 1) -> float:
    """Return how far toward the setpoints went."""
    return max(direction * sample.position for sample in course.samples)


def assert_homed(course: Course, true_home: float, direction: int = 1, more: float = 1e-9) -> None:
    """Assert that a run found the true home, within the uncertainty that it reports."""
    found = home_of(course, direction)
    assert course.outcome is not None
    assert abs(found - true_home) <= course.outcome.uncertainty + more


# -- what goes wrong between the plant and the axis -----------------------------------------------


class Spoilt(Rehearsal):
    """A rehearsal in which every happening passes through ``spoil`` on its way to the axis."""

    spoil: Callable[[Happening], Iterable[Happening]] = staticmethod(lambda one: (one,))

    def _report(self, happening: Happening) -> None:
        for one in self.spoil(happening):
            super()._report(one)


def spoilt(
    one: Rig,
    spoil: Callable[[Happening], Iterable[Happening]],
    direction: int = 1,
    start: float | None = None,
) -> Spoilt:
    """Return a rehearsal of a rig whose happenings pass through a function."""
    made = one.rehearsal(direction, start)
    made.__class__ = Spoilt
    made.spoil = spoil
    return made


def bouncing(every: float = 0.0005, times: int = 3) -> Callable[[Happening], Iterable[Happening]]:
    """Return a spoiler: every edge of a switch bounces ``times``, ``every`` s apart."""

    def bounce(one: Happening) -> Iterable[Happening]:
        if not isinstance(one.value, bool):
            return (one,)
        return [
            one._replace(time=one.time + i * every, value=one.value == (i % 2 == 0))
            for i in range(2 * times + 1)
        ]

    return bounce


def with_another_flag(made: Rehearsal, switch: str, low: float, high: float) -> Rehearsal:
    """Give a switch another flag, raw; the axis starts on one of both at most."""
    another = _Switch(switch, SwitchLayout(low, high), made.plant.position)
    made.plant._switches.append(another)
    made.plant._find_quiet()
    if another.on:
        introduce_again(made)
    return made


def introduce_again(made: Rehearsal) -> None:
    """Let the drivers of a rehearsal read the plant anew, because its switches were changed."""
    levels = made.plant.levels().items()
    made._drivers = {name: made._driver(name, level) for name, level in levels}
    made._introduce()


def injected(made: Rehearsal, state: str, inputs: Mapping[str, bool], after: int = 1) -> Course:
    """Home; once in a state for ``after`` cycles, send levels of switches."""
    made.axis.home(made.time)
    seen = 0
    while made.axis.running:
        made.cycle()
        seen += made.axis.state == state
        if seen == after:
            seen += 1
            for name, level in inputs.items():
                made.axis.switch(Input(name), made.time, level)
    return made.finish()
