# SPDX-License-Identifier: Apache-2.0
"""An example of every home type: parameters, the axis it homes, and the runs worth seeing.

The documentation's figures are these runs. All axes home toward positive, are 120 mm long and
move slowly enough for their overrun to be seen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from ..course import Course
from ..parameters.axis import AxisParameters, axis_parameters
from ..plant.layout import AxisLayout, SwitchLayout
from ..procedures.states import HomeType, Input
from .run import rehearse


class Run(NamedTuple):
    """What is seen in a run, and the raw position where it starts, m."""

    title: str
    start: float


@dataclass(frozen=True)
class Example:
    """A home type on an axis that shows it well."""

    parameters: AxisParameters
    layout: AxisLayout
    runs: tuple[Run, ...]

    def rehearse(self, run: Run) -> Course:
        return rehearse(self.parameters, self.layout, position=run.start)


TRAVEL = 0.12
MOTION = {
    'travel': TRAVEL,
    'homing_velocity_fast': 0.04,
    'homing_velocity_fast_acc': 0.2,
    'homing_velocity_fast_dec': 0.2,
    'homing_velocity_slow': 0.01,
    'homing_velocity_slow_acc': 0.2,
    'homing_velocity_slow_dec': 0.2,
    'homing_reverse_distance': 0.006,
    'home_shift_velocity': 0.02,
    'home_shift_acc': 0.2,
    'home_shift_dec': 0.2,
    'max_jerk': 4.0,
}

HOME = SwitchLayout(0.070, 0.080, hysteresis=0.00005)
NEGATIVE = SwitchLayout(-0.05, 0.006)
POSITIVE = SwitchLayout(0.108, 0.17)
NEAR = SwitchLayout(0.088, 0.17)
EXTERNAL = SwitchLayout(0.098, 0.17)

BEFORE = Run('from before the home switch', 0.030)
ON = Run('starting on the home switch', 0.075)
BEYOND = Run('meeting the limit switch', 0.094)
IN_REACH = Run('from within the travel', 0.055)
ON_LIMIT = Run('starting on the limit switch', 0.110)

#: What a type needs besides the limit switches at both ends.
HS = (Input.HOME_SWITCH,)
INDEX = (Input.Z_PULSE,)
PROBE = (Input.TOUCH_PROBE,)
NEAR_LIMIT = (Input.NEAR_POSITIVE_LIMIT_SWITCH,)
EXTERNAL_LIMIT = (Input.EXTERNAL_POSITIVE_LIMIT_SWITCH,)

FLAGS: Mapping[Input, SwitchLayout] = {
    Input.HOME_SWITCH: HOME,
    Input.POSITIVE_LIMIT_SWITCH: POSITIVE,
    Input.NEGATIVE_LIMIT_SWITCH: NEGATIVE,
    Input.NEAR_POSITIVE_LIMIT_SWITCH: NEAR,
    Input.EXTERNAL_POSITIVE_LIMIT_SWITCH: EXTERNAL,
}


def example(
    home_type: HomeType,
    inputs: tuple[Input, ...],
    *runs: Run,
    flags: Mapping[Input, SwitchLayout] = FLAGS,
    limits: tuple[Input, ...] = (Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH),
    index_offset: float = 0.0,
    **parameters: object,
) -> Example:
    """Give an example in which ``inputs`` and ``limits`` are fitted and wired."""
    fitted = (*limits, *inputs)
    layout = AxisLayout(
        hard_stops=(0.0, TRAVEL),
        switches={str(name): flags[name] for name in fitted if name in flags},
        index_pitch=0.02 if Input.Z_PULSE in inputs else 0.0,
        index_offset=index_offset,
        touch_probe=0.077 if Input.TOUCH_PROBE in inputs else None,
        lag=0.004,
    )
    values = {'home_type': str(home_type), 'switches': fitted, **MOTION, **parameters}
    return Example(axis_parameters(values), layout, runs)


def on_near_limit(home_type: HomeType) -> Example:
    """Give an example that homes on the near limit switch."""
    return example(
        home_type,
        NEAR_LIMIT,
        IN_REACH,
        ON_LIMIT._replace(start=0.092),
        near_ls_type='Dec',
        home_shift_distance=-0.010,
    )


def on_external_limit(home_type: HomeType) -> Example:
    """Give an example that homes on the external limit switch, beyond the near one."""
    return example(
        home_type,
        NEAR_LIMIT + EXTERNAL_LIMIT,
        IN_REACH,
        ON_LIMIT._replace(start=0.102),
        near_ls_type='Dec',
        external_ls_type='Dec',
        home_shift_distance=-0.020,
    )


def mechanical_end(
    home_type: HomeType, inputs: tuple[Input, ...] = (), **parameters: object
) -> Example:
    """Give an example that finds the hard stop ahead, where no limit switch is in the way."""
    return example(
        home_type,
        inputs,
        Run('from before the hard stop', 0.095),
        flags={**FLAGS, Input.HOME_SWITCH: SwitchLayout(0.100, 0.112, hysteresis=0.00005)},
        limits=(Input.NEGATIVE_LIMIT_SWITCH,),
        index_offset=0.009,
        mechanical_end_detection_pos_diff=0.003,
        mechanical_end_detection_time=0.1,
        **parameters,
    )


def _by_home_type(*examples: Example) -> Mapping[HomeType, Example]:
    return MappingProxyType({one.parameters.home_type: one for one in examples})


EXAMPLES = _by_home_type(
    example(HomeType.HS, HS, BEFORE, ON, BEYOND),
    example(HomeType.HSZPulse, HS + INDEX, BEFORE, ON, BEYOND, index_offset=0.018),
    example(HomeType.HSReverseZPulse, HS + INDEX, BEFORE, ON, BEYOND, index_offset=0.003),
    example(HomeType.HSHS, HS, BEFORE, ON, BEYOND),
    example(HomeType.HSTouchProbe, HS + PROBE, BEFORE, ON, BEYOND),
    example(HomeType.HSOff, HS, BEFORE, ON, BEYOND),
    example(HomeType.HSOffZPulse, HS + INDEX, BEFORE, ON, BEYOND, index_offset=0.010),
    example(HomeType.HSOffReverseZPulse, HS + INDEX, BEFORE, ON, BEYOND, index_offset=0.014),
    example(HomeType.LS, (), IN_REACH, ON_LIMIT, home_shift_distance=-0.010),
    example(HomeType.LSReverseZPulse, INDEX, IN_REACH, ON_LIMIT, index_offset=0.002),
    on_near_limit(HomeType.NearLS),
    example(
        HomeType.NearLSReverseZPulse,
        NEAR_LIMIT + INDEX,
        IN_REACH,
        ON_LIMIT._replace(start=0.092),
        near_ls_type='Dec',
        index_offset=0.002,
    ),
    on_external_limit(HomeType.ExternalLS),
    example(
        HomeType.ExternalLSReverseZPulse,
        EXTERNAL_LIMIT + INDEX,
        IN_REACH,
        ON_LIMIT._replace(start=0.102),
        external_ls_type='Dec',
        index_offset=0.012,
    ),
    example(HomeType.CurrentPos, (), Run('with a home shift', 0.040), home_shift_distance=0.030),
    example(HomeType.ZPulse, INDEX, IN_REACH, index_offset=0.010),
    example(HomeType.TouchProbe, PROBE, IN_REACH),
    mechanical_end(HomeType.MechanicalEndDetection, home_shift_distance=-0.010),
    mechanical_end(HomeType.MechanicalEndDetectionHS, HS),
    mechanical_end(
        HomeType.MechanicalEndDetectionLS,
        (Input.POSITIVE_LIMIT_SWITCH,),
        mechanical_end_detection_ignore_ls=True,
    ),
    mechanical_end(HomeType.MechanicalEndDetectionReverseZPulse, INDEX),
    example(HomeType.HSReverse, HS, BEFORE, ON, BEYOND),
    example(HomeType.HSOffReverse, HS, BEFORE, ON, BEYOND),
    example(HomeType.LSOff, (), IN_REACH, ON_LIMIT, home_shift_distance=-0.010),
    on_near_limit(HomeType.NearLSOff),
    on_external_limit(HomeType.ExternalLSOff),
    example(HomeType.LSLS, (), IN_REACH, ON_LIMIT, home_shift_distance=-0.010),
    on_near_limit(HomeType.NearLSNearLS),
    on_external_limit(HomeType.ExternalLSExternalLS),
)
