# SPDX-License-Identifier: Apache-2.0
"""Every scenario that goes wrong ends at home, or in a controlled stop with a named error.

`make test-faults` prints the table of them; doc/faults.md has the same.
"""

import gc
import importlib.util
import threading
import tracemalloc
from itertools import pairwise
from pathlib import Path

import pytest
from core_rig import DIRECTIONS
from fault_scenarios import BETWEEN, CASES, ELSEWHERE, HSHS, faulty

from homing_node.check import check_axis
from homing_node.procedures.states import Error, State

ROOT = Path(__file__).resolve().parent.parent


def table_script():
    spec = importlib.util.spec_from_file_location('faults_page', ROOT / 'scripts' / 'faults.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize('direction', DIRECTIONS, ids=['positive', 'negative'])
@pytest.mark.parametrize('case', CASES, ids=lambda case: case.id)
def test_scenario(case, direction):
    made = case.run(direction)
    outcome = made.course.outcome
    assert outcome.error is case.error, outcome.message
    if case.home is not None:
        found = direction * outcome.home_position_raw
        assert abs(found - case.home) <= outcome.uncertainty + 1e-9
    if not outcome.success:
        assert outcome.message.startswith('axis x: ')
        assert case.says in outcome.message
        assert case.stops(made) <= case.stop
        assert not made.axis.homed or case.error is Error.Busy
    if case.checked:
        findings = check_axis('x', made.axis.parameters, made.layout)
        assert case.checked in [finding.check for finding in findings]
    assert_smooth(made)
    assert_contained(made, case.hits)
    # Nothing moves by itself afterwards.
    assert made.axis.state is State.Idle
    assert [made.cycle() for _ in range(50)] == [None] * 50


def assert_smooth(made):
    """Assert that no setpoint is a step, and that the last one is at rest.

    The stop after a FollowingError begins where the feedback says that the axis is.
    """
    p, period = made.axis.parameters, made.period
    velocity = max(p.homing_velocity_fast, p.home_shift_velocity)
    acceleration = max(p.homing_velocity_fast_dec, p.ls_dec)
    pairs = list(pairwise(made.course.samples))
    if made.course.outcome.error is Error.FollowingError:
        limit = acceleration * period * 1.001
        restarts = [pair for pair in pairs if abs(pair[1].velocity - pair[0].velocity) > limit]
        assert len(restarts) <= 1
        pairs = [pair for pair in pairs if pair not in restarts]
    for one, two in pairs:
        assert abs(two.position - one.position) <= velocity * period * (1 + 1e-6) + 1e-12
        assert abs(two.velocity - one.velocity) <= acceleration * period * (1 + 1e-6) + 1e-9
        assert abs(two.acceleration - one.acceleration) <= p.max_jerk * period * (1 + 1e-4) + 1e-6
    if made.course.samples and made.course.outcome.error is not Error.ServoOff:
        assert made.course.samples[-1].velocity == 0.0


def assert_contained(made, hits):
    """Assert that the axis came to a hard stop only where that is the scenario."""
    low, high = made.layout.hard_stops
    at_stop = made.low <= low or made.high >= high
    ended = made.axis.parameters.homes_on_mechanical_end and made.course.outcome.success
    assert at_stop == (hits or ended)


def test_every_scenario_of_the_survey_has_its_place():
    numbers = {*(case.number for case in CASES), *(row.number for row in BETWEEN), *ELSEWHERE}
    assert numbers - {'-'} == {str(n) for n in range(1, 54)}


@pytest.mark.parametrize('row', BETWEEN, ids=lambda row: f'{row.number} {row.name}')
def test_every_scenario_between_processes_is_tested(row):
    file, _, name = row.test.partition('::')
    assert f'\ndef {name}(' in (ROOT / 'test' / file).read_text()


def test_the_page_is_generated():
    page = table_script()
    assert page.PAGE.read_text() == page.page(), 'make docs'


# -- for long -------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_thousand_homings_in_a_row():
    """Neither memory nor threads nor the time of a run grow."""
    made = faulty(HSHS.but(homing_velocity_slow=0.2), 1, start=0.055)
    layout, rest = made.layout, []

    def home(times):
        for _ in range(times):
            outcome = made.home().outcome
            assert outcome.success, outcome.message
            rest.append((outcome.home_position_raw, len(made.course.samples)))

    assert layout.start == 0.055
    home(200)
    threads = threading.active_count()
    tracemalloc.start()
    try:
        home(100)
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        home(700)
        gc.collect()
        after = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert threading.active_count() == threads
    # What the test itself keeps is a few numbers a run: 200 bytes.
    assert after - before < 700 * 250
    steady = rest[300:]
    assert {cycles for _, cycles in steady} == {cycles for _, cycles in rest[1:300]}
    assert max(home for home, _ in steady) - min(home for home, _ in steady) < 1e-6
