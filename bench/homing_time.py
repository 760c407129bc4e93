# SPDX-License-Identifier: Apache-2.0
"""How long homing takes, in simulated time.

The switch is on from 100 to 110 mm, index pulses every 10 mm at 3.7 mm; fast 50, slow 5 mm/s,
1 m/s^2, jerk 100 m/s^3. The counterpart is the sum of the time-optimal legs (ruckig), each from
the state in which an event found the axis to the state at the next one, to rest after the overrun,
and to rest at home. The starts are spread around the scenario's by a cycle's way in all, so that
the switch rises at every time within a cycle. A quick run knows the switch from a cold one, and
goes to it at 250 mm/s.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import copysign
from statistics import median
from typing import NamedTuple

from figures import Figure, within
from ruckig import ControlInterface, InputParameter, Ruckig, Trajectory

from homing_node.core.outcome import Outcome
from homing_node.course import Course, Sample
from homing_node.parameters.axis import AxisParameters, axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.run import Rehearsal

FAST, SLOW, ACCELERATION, JERK = 0.05, 0.005, 1.0, 100.0
QUICK = 0.25
LAYOUT = AxisLayout(
    (-0.05, 0.205),
    {
        'home_switch': SwitchLayout(0.1, 0.11),
        'positive_limit_switch': SwitchLayout(0.195, 0.3),
        'negative_limit_switch': SwitchLayout(-0.1, -0.04),
    },
    index_pitch=0.01,
    index_offset=0.0037,
)


class Scenario(NamedTuple):
    """A home type and where the axis starts, m; what LinuxCNC 2.9 took, unlimited jerk, s."""

    name: str
    home_type: str
    start: float
    linuxcnc: float | None = None


SCENARIOS = (
    Scenario('A', 'HSHS', 0.0, 2.742),
    Scenario('B', 'HSReverseZPulse', 0.0),
    Scenario('B', 'HSZPulse', 0.0),
    Scenario('C (on the switch)', 'HSHS', 0.105, 1.153),
    Scenario('C (on the switch)', 'HS', 0.105),
)
RATES = {1000.0: 1000.0, 250.0: 500.0}  # of the cycle and of its feedback, Hz
STARTS = 16


def parameters(home_type: str, **more: object) -> AxisParameters:
    """Return the parameters of an axis that homes on this layout."""
    accelerations = {
        f'{pace}_{kind}': ACCELERATION
        for kind in ('acc', 'dec')
        for pace in ('homing_velocity_fast', 'homing_velocity_slow', 'home_shift')
    }
    wired = [*LAYOUT.switches, 'z_pulse']
    return axis_parameters(
        {
            'home_type': home_type,
            'travel': 0.2,
            'homing_velocity_fast': FAST,
            'homing_velocity_slow': SLOW,
            'max_jerk': JERK,
            'switches': wired,
            **accelerations,
            **more,
        }
    )


def home(scenario: Scenario, rate: float) -> tuple[Course, list[object]]:
    """Run a scenario; return its course and the row of the table of each sample."""
    rehearsal = Rehearsal(
        parameters(scenario.home_type),
        LAYOUT,
        Transport(update_rate=rate, feedback_rate=RATES[rate]),
        scenario.start,
    )
    rehearsal.cycle()
    refusal = rehearsal.axis.home(rehearsal.time)
    assert refusal is None, refusal
    rows: list[object] = []
    while (machine := rehearsal.axis.machine) is not None:
        if rehearsal.cycle() is not None:
            row = machine.step
            rows.append(row)
    assert rehearsal.axis.homed, rehearsal.axis.message
    return rehearsal.course, rows


def settled(samples: Sequence[Sample]) -> int:
    """Return the number of samples until the command is at rest for good."""
    last = max(i for i, sample in enumerate(samples) if sample.velocity != 0.0)
    return min(last + 2, len(samples))


def legs(samples: Sequence[Sample], rows: Sequence[object]) -> Iterator[tuple[Sample, Sample]]:
    """Split a course at its events: yields the last samples before and in each row."""
    ends = [i for i, (one, another) in enumerate(pairwise(rows)) if one != another]
    return pairwise([samples[0], *(samples[i] for i in ends), samples[-1]])


def optimum(samples: Sequence[Sample], rows: Sequence[object]) -> float:
    """Return the time-optimal duration of a course through the same events, s."""
    return sum(optimal_leg(start, end) for start, end in legs(samples, rows))


def optimal_leg(start: Sample, end: Sample) -> float:
    """Return the least time from one state to another, s.

    Where it ends slowly it goes slowly, from a stretch of braking on that begins at once.
    """
    slow = 0.0 < abs(end.velocity) <= SLOW * (1 + 1e-9)
    given, trajectory = InputParameter(1), Trajectory(1)
    given.current_position, given.target_position = [start.position], [end.position]
    given.current_velocity, given.target_velocity = [start.velocity], [end.velocity]
    given.current_acceleration = [start.acceleration]
    given.target_acceleration = [end.acceleration]
    given.max_velocity = [(SLOW if slow else FAST) * (1 + 1e-9)]
    given.max_acceleration, given.max_jerk = [ACCELERATION * (1 + 1e-9)], [JERK]
    braking = 0.0
    if slow and abs(start.velocity) > SLOW:  # where ruckig would brake too far, and come back
        given.control_interface = ControlInterface.Velocity
        given.target_velocity = [copysign(SLOW, end.velocity)]
        given.target_acceleration = [0.0]
        Ruckig(1).calculate(given, trajectory)
        braking = trajectory.duration
        (given.current_position, given.current_velocity, given.current_acceleration) = (
            trajectory.at_time(braking)
        )
        given.control_interface = ControlInterface.Position
        given.target_velocity = [end.velocity]
        given.target_acceleration = [end.acceleration]
    Ruckig(1).calculate(given, trajectory)
    return braking + float(trajectory.duration)


class Duration(NamedTuple):
    """How long a run took, s: until the command rested, at best, and until the axis was homed."""

    moving: float
    best: float
    whole: float


def measure(scenario: Scenario, rate: float) -> Duration:
    """Time a run."""
    course, rows = home(scenario, rate)
    count = settled(course.samples)
    samples = course.samples[:count]
    return Duration(
        samples[-1].time - samples[0].time, optimum(samples, rows[:count]), course.duration
    )


def once_more(start: float, rate: float) -> tuple[Outcome, float, Outcome]:
    """Home scenario A twice from the same start, the second time quickly.

    Returns:
        The outcome of the cold run, the duration of the quick one in s, and its outcome.
    """
    known = None
    outcomes = []
    for _ in range(2):
        rehearsal = Rehearsal(
            parameters('HSHS', rehome=True, rehome_velocity=QUICK),
            LAYOUT,
            Transport(update_rate=rate, feedback_rate=RATES[rate]),
            start,
        )
        rehearsal.axis.remembered = known
        rehearsal.cycle()
        refusal = rehearsal.axis.home(rehearsal.time)
        assert refusal is None, refusal
        course = rehearsal.finish()
        assert rehearsal.axis.homed, rehearsal.axis.message
        known = rehearsal.axis.remembered
        outcomes.append(rehearsal.axis.outcome)
    return outcomes[0], course.duration, outcomes[1]


def quick_figures() -> Iterator[Figure]:
    """Yield what a run takes that knows where the switch is, and how exact it is."""
    for rate in RATES:
        starts = [((i + 0.5) / STARTS - 0.5) * FAST / rate for i in range(STARTS)]
        runs = [once_more(start, rate) for start in starts]
        name = f'A, rehome at {QUICK:g} m/s: HSHS, {rate:g} Hz'
        bare = [SCENARIOS[0].linuxcnc or 0.0] * STARTS
        whole = [duration for _, duration, _ in runs]
        yield within(f'{name}, until homed, against LinuxCNC', 's', whole, bare, 0.45)
        yield within(
            f'{name}, uncertainty, against the cold run',
            'µm',
            [1e6 * again.uncertainty for _, _, again in runs],
            [1e6 * cold.uncertainty for cold, _, _ in runs],
            1.01,
        )


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the duration of each scenario."""
    yield from quick_figures()
    for scenario in SCENARIOS[:1] if quick else SCENARIOS:
        for rate in RATES:
            starts = [
                scenario.start + ((i + 0.5) / STARTS - 0.5) * FAST / rate for i in range(STARTS)
            ]
            runs = [measure(scenario._replace(start=start), rate) for start in starts]
            name = f'{scenario.name}: {scenario.home_type}, {rate:g} Hz'
            yield within(
                f'{name}, until the command rests, against its optimal legs',
                's',
                [run.moving for run in runs],
                [run.best for run in runs],
                1.01,
            )
            whole = [run.whole for run in runs]
            goal = ('A ≤ 2.58', median(whole) <= 2.58) if scenario.name == 'A' else ('', None)
            bare = [scenario.linuxcnc] * STARTS if scenario.linuxcnc else []
            yield Figure(
                f'{name}, until homed' + (', against LinuxCNC' if bare else ''),
                's',
                whole,
                bare,
                *goal,
            )
