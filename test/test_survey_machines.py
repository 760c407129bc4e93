# SPDX-License-Identifier: Apache-2.0
"""Surveys of random machines by jogs: true within their uncertainty, and good to home with."""

import random
from dataclasses import replace
from math import inf
from statistics import fmean

import pytest

from homing_node.check import errors
from homing_node.check.proposal import propose
from homing_node.core.jog import Jog
from homing_node.parameters.axis import axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Input
from homing_node.rehearsal.run import Rehearsal, Transport
from homing_node.survey.judgement import judge
from homing_node.survey.passes import Pass, SeenEdge
from homing_node.survey.plan import Plan

HS, UP, DOWN = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'
LENGTH, VELOCITY = 0.08, 0.04
HOME_TYPES = (
    *('HS', 'HSHS', 'HSOff', 'HSZPulse', 'HSReverseZPulse', 'HSReverse', 'HSTouchProbe'),
    *('HSOffZPulse', 'LS', 'LSLS', 'LSOff', 'LSReverseZPulse', 'HSOffReverse', 'ZPulse'),
    *('NearLS', 'NearLSReverseZPulse', 'ExternalLSExternalLS', 'TouchProbe'),
    *('MechanicalEndDetectionHS', 'MechanicalEndDetectionReverseZPulse'),
)
#: How many machines there are; the short suite has some of them.
MACHINES = 20
#: Runs, of which the mean is predicted: each is some polls longer or shorter.
RUNS = 8


def seeds(short):
    """Return the seeds of all machines; those beyond the first few are for the long suite."""
    long = [pytest.param(seed, marks=pytest.mark.long) for seed in range(short, MACHINES)]
    return [*range(short), *long]


def jogged(made, move):
    """Make one motion of a survey; return what it has brought."""
    begin = made.plant.position
    course = made.jog(Jog(*move), 1000.0)
    for _ in range(50):
        made.cycle()  # until the axis rests
    way = 1 if move.distance > 0.0 else -1
    steady = [one for one in course.samples if abs(abs(one.velocity) - move.velocity) < 1e-9]
    behind = [way * (one.position - one.feedback) for one in steady]
    told = course.outcome.jogged
    return Pass(
        begin,
        made.plant.position,
        way * move.velocity,
        tuple(SeenEdge(*one[1:]) for one in (told.edges if told else ())),
        course.outcome.error,
        course.outcome.message,
        tuple(one - move.velocity * made.period for one in behind[len(behind) // 2 :][:1]),
    )


def survey(parameters, layout, transport, velocity):
    """Survey a simulated axis; return the judgement and the plan."""
    made = Rehearsal(parameters, layout, transport)
    plan = Plan(layout.start, LENGTH, velocity, parameters.travel)
    levels = {
        Input(name): level is not parameters.inverted(Input(name))
        for name, level in made.plant.levels().items()
    }
    while (move := plan.next()) is not None:
        plan.add(jogged(made, move))
    return judge(parameters, plan.passes, levels, hard_stops=layout.hard_stops), plan


def limits(home_type):
    """Return the limit switches that an axis meets first, of the upper and of the lower end."""
    kind = next((kind for kind in ('near_', 'external_') if kind[:-1] in home_type.lower()), '')
    return kind + UP, kind + DOWN


def polarity_of(name):
    """Return the parameter that inverts a switch."""
    return f'invert_{name}_polarity'.replace('home_switch', 'hs').replace('limit_switch', 'ls')


def machine(seed):
    """Return a random machine: parameters that know how it is wired, layout, transport."""
    r = random.Random(seed)
    home_type = HOME_TYPES[seed % len(HOME_TYPES)]
    up, down = limits(home_type)
    low = r.uniform(-0.1, 0.1)
    high, room = low + LENGTH, r.uniform(0.010, 0.015)
    flag = low + r.uniform(0.3, 0.45) * LENGTH
    places = {
        HS: (flag, flag + r.choice([0.004, 0.01, 0.02])),
        up: (high - room, inf),
        down: (-inf, low + room),
    }
    if up != UP:  # a hardware limit stands beyond
        places |= {UP: (high - room + 0.004, inf), DOWN: (-inf, low + room - 0.004)}
    inverted = {name: r.random() < 0.5 for name in places}
    flags = {
        name: SwitchLayout(*place, r.choice([0.0, 2e-5, 5e-4]), inverted[name])
        for name, place in places.items()
    }
    layout = AxisLayout(
        (low, high),
        flags,
        index_pitch=r.choice([0.002, 0.005]),
        index_offset=r.uniform(0.0, 0.002),
        touch_probe=r.uniform(0.4, 0.6) * LENGTH + low,
        lag=r.choice([0.0, 0.004, 0.02]),
        start=r.uniform(low + room, high - room),
    )
    mechanical = home_type.startswith('MechanicalEnd')
    parameters = axis_parameters(
        {
            'home_type': home_type,
            'home_direction': r.choice(['Positive', 'Negative']),
            'travel': LENGTH,
            'homing_velocity_fast': VELOCITY,
            'homing_velocity_slow': 0.005,
            'max_jerk': 100.0,
            'switches': [*places, 'z_pulse', 'touch_probe'],
            'near_ls_type': 'Dec',
            'external_ls_type': 'Dec',
            **({'mechanical_end_detection_pos_diff': 0.002} if mechanical else {}),
            **{polarity_of(name): value for name, value in inverted.items()},
        }
    )
    transport = Transport(
        seed=seed,
        switch_delay=r.uniform(0.0, 0.004),
        feedback_delay=r.uniform(0.0, 0.004),
        jitter=r.uniform(0.0, 0.002),
        stamp_error=r.choice([0.0, 0.002]),
        stamp_late=r.choice([0.0, 0.003, 0.012]),
        poll_rate=r.choice([0.0, 0.0, 100.0]),
    )
    return parameters, layout, transport


def true(layout, key):
    """Return what stands in the true layout for a key of a survey's uncertainties."""
    name, _, n = key.partition('[')
    if n:
        return layout.switches[name][int(n[0])]
    if key.endswith('_hysteresis'):
        return layout.switches[key.removesuffix('_hysteresis')].hysteresis
    return getattr(layout, key)


@pytest.mark.parametrize('seed', seeds(8))
def test_every_edge_is_within_its_uncertainty(seed):
    parameters, layout, transport = machine(seed)
    found, plan = survey(parameters, layout, transport, VELOCITY)
    assert plan.failure is None and found.doubts == []
    up, down = limits(parameters.home_type)
    expected = {f'{HS}[0]', f'{HS}[1]', f'{up}[0]', f'{down}[1]', 'index_pitch', 'index_offset'}
    expected |= {f'{name}_hysteresis' for name in (HS, up, down)} | {'touch_probe'}
    assert found.exact.keys() == expected
    for key, half in found.exact.items():
        off = true(found.layout, key) - true(layout, key)
        if key == 'index_offset':
            off -= layout.index_pitch * round(off / layout.index_pitch)
        assert abs(off) <= half + 1e-12, (key, off, half)
        assert half < 1e-3
    assert found.layout.lag == pytest.approx(layout.lag, abs=0.1 * layout.lag + 1e-3)


@pytest.mark.parametrize('seed', seeds(1))
def test_a_run_is_what_the_rehearsal_of_the_survey_says(seed):
    """What is proposed for the surveyed layout is right for the true one, too."""
    parameters, layout, transport = machine(seed)
    found, _ = survey(parameters, layout, transport, 0.25 * VELOCITY)
    if found.latest:  # it says that a higher velocity tells more
        found, _ = survey(parameters, layout, transport, VELOCITY)
    if found.latest:  # or what covers it
        parameters = replace(parameters, switch_stamp_error=found.latest)
    parameters = replace(parameters, **found.advice)
    proposed, wrong = put_right(parameters, found.layout)
    assert wrong == put_right(parameters, layout)[1]
    assert not wrong
    up, down = limits(parameters.home_type)
    low, high = layout.switches[down].on_to, layout.switches[up].on_from
    start = low + 1e-3 if parameters.home_direction.sign > 0 else high - 1e-3
    predicted, real = (
        [
            Rehearsal(proposed, one, replace(transport, seed=one_seed), start).home()
            for one_seed in range(RUNS)
        ]
        for one in (found.layout, layout)
    )
    for course in real:
        assert course.outcome.success, course.outcome.message
    lasts = fmean(map(duration, real))
    # What is open of the hysteresis is way at the slow velocity.
    unknown = max(half for key, half in found.exact.items() if 'hysteresis' in key)
    unknown /= proposed.homing_velocity_slow
    assert abs(fmean(map(duration, predicted)) - lasts) <= 0.02 * lasts + unknown
    for one, other in zip(predicted, real, strict=True):
        doubt = one.outcome.uncertainty + other.outcome.uncertainty + max(found.exact.values())
        off = one.outcome.home_position_raw - other.outcome.home_position_raw
        assert abs(off) <= doubt


def put_right(parameters, layout):
    """Return the proposed parameters, and the errors that are left."""
    proposal = propose('x', parameters, layout)
    return proposal.parameters, {one.check for one in errors(list(proposal.findings))}


def duration(course):
    return course.samples[-1].time - course.samples[0].time
