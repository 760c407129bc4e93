# SPDX-License-Identifier: Apache-2.0
"""Has something moved? What the memory says of simulated runs, and how often it is wrong."""

import random
import re

import pytest

from homing_node.memory.comparison import Memory, rules_of
from homing_node.memory.quantities import FLAG, HOME, INDEX, LIMIT, PLAY, quantities_of
from homing_node.memory.records import Run
from homing_node.memory.series import FIRST, Series
from homing_node.memory.trends import trend_of
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.units import Unit

UM = 1e-6
PITCH = 0.01


def rules(**changes):
    values = {'home_type': 'HSHS', 'travel': 0.2, 'encoder': 'absolute', **changes}
    return rules_of(axis_parameters(values))


def run(number, home, **changes):
    values = {
        'uncertainty': 2 * UM,
        'frame': 'absolute',
        'configuration': 'c',
        'quantities': {HOME: (home, 2 * UM)},
        **changes,
    }
    return Run(number, 1.7e9 + 60 * number, 'home', 'NoError', 2.5, home, **values)


def noise(seed, count, deviation=1 * UM):
    rng = random.Random(seed)
    return [rng.gauss(0.1, deviation) for _ in range(count)]


def memory_of(homes, **changes):
    memory = Memory(rules(**changes), 'c')
    memory.replay(run(i + 1, home, pitch=PITCH) for i, home in enumerate(homes))
    return memory


def judge(memory, home, **changes):
    """Judge a further run, and keep it."""
    one = run(memory.next_number, home, pitch=PITCH, **changes)
    judgement = memory.judge(one)
    memory.add(one)
    return judgement


def size_in(text):
    """Return the first length of a text that has a sign, m."""
    number, prefix = re.search(r'([+-][0-9.]+) ([mµ]?)m\b', text).groups()
    return float(number) * {'': 1.0, 'm': 1e-3, 'µ': 1e-6}[prefix]


# -- the baseline ---------------------------------------------------------------------------------


def test_the_first_runs_only_collect():
    memory = memory_of([], home_change_limit=0.001, home_change_warn=0.0005)
    for home in (0.1, 0.15, 0.1, 0.05, 0.1):
        assert judge(memory, home) == ((), '')
    assert judge(memory, 0.15).moved


@pytest.mark.parametrize('size', [50 * UM, -200 * UM, PITCH])
def test_a_moved_switch_is_a_warning_in_the_second_run(size):
    memory = memory_of(noise(1, 30))
    assert judge(memory, 0.1 + size) == ((), '')
    (text,), moved = judge(memory, 0.1 + size)
    assert not moved
    assert text.startswith('home moved by ') and size_in(text) == pytest.approx(size, rel=0.05)
    assert 'since run 31 (20' in text and 'steady within 2 µm' in text
    assert ('about one pitch of the index' in text) == (size == PITCH)
    for _ in range(50):  # it is told until it is accepted, and never enters the baseline
        (text,), _ = judge(memory, 0.1 + size)
        assert 'since run 31' in text


def test_one_outlier_is_none():
    memory = memory_of(noise(2, 30))
    assert judge(memory, 0.1 + 0.003) == ((), '')
    for home in noise(3, 30):
        assert judge(memory, home) == ((), '')
    assert judge(memory, 0.1 + 0.003) == ((), '')
    assert memory.trends() == ()


def test_home_change_warn_warns_at_once():
    memory = memory_of(noise(4, 30), home_change_warn=8 * UM)
    assert judge(memory, 0.1 + 5 * UM) == ((), '')
    (text,), moved = judge(memory, 0.1 + 9.5 * UM)
    assert size_in(text) == pytest.approx(9.5 * UM, rel=0.1)
    assert 'since this run' in text and not moved


def test_home_change_limit_refuses_until_it_is_accepted():
    memory = memory_of(noise(5, 30), home_change_limit=30 * UM)
    assert judge(memory, 0.1 + 29 * UM).moved == ''
    for _ in range(20):
        moved = judge(memory, 0.1 - 50 * UM).moved
        assert size_in(moved) == pytest.approx(-50 * UM, rel=0.05) and 'more than 30 µm' in moved
    accepted = memory.accept()
    assert accepted.number == memory.runs[-1].number and accepted.accepted
    again = Memory(rules(home_change_limit=30 * UM), 'c')
    again.replay(memory.runs)  # after a restart
    for one in (memory, again):
        for home in noise(6, 20):
            assert judge(one, home - 50 * UM) == ((), '')
        assert judge(one, 0.1).moved


def test_statistics_alone_never_stop_a_machine():
    memory = memory_of(noise(7, 30))
    for _ in range(10):
        assert judge(memory, 0.15).moved == ''


def test_the_uncertainty_and_the_resolution_are_the_least_scale():
    memory = Memory(rules(), 'c')
    for number in range(1, 31):
        memory.add(run(number, 0.1))  # not a count of spread
    for _ in range(5):
        assert judge(memory, 0.1 + 9.9 * UM) == ((), '')  # 5 x 2 µm
    judge(memory, 0.1 + 10.1 * UM)
    assert judge(memory, 0.1 + 10.1 * UM).warnings


def test_nothing_to_accept():
    memory = memory_of([])
    assert memory.accept() is None
    memory.add(run(1, None, quantities={}))
    assert memory.accept() is None


def test_another_configuration_has_another_baseline_and_changed_back_has_the_old_one():
    memory = memory_of(noise(8, 30), home_change_limit=30 * UM)
    assert memory.judge(run(31, 0.11)).moved
    changed = rules(home_change_limit=30 * UM)
    memory.configure(changed, 'd')
    assert judge(memory, 0.11, configuration='d') == ((), '')
    memory.configure(changed, 'c')
    assert memory.judge(run(32, 0.11)).moved
    assert memory.judge(run(32, 0.1)) == ((), '')


def test_an_incremental_encoder_compares_raw_homes_only_as_long_as_it_has_power():
    memory = Memory(rules(encoder='incremental', home_change_limit=30 * UM), 'c')

    def add(home, frame, flag):
        quantities = {HOME: (home, 2 * UM), FLAG: (flag, 4 * UM)}
        return judge(memory, home, frame=frame, quantities=quantities)

    for home in noise(9, 10):
        assert add(home, 'boot 1', 0.006) == ((), '')
    assert add(0.1 + 50 * UM, 'boot 1', 0.006).moved.startswith('home moved')  # lost counts
    for home in noise(10, 10):
        assert add(home + 0.02, 'boot 2', 0.006) == ((), '')
    assert add(0.12, 'boot 3', 0.0061).moved.startswith(FLAG)


def test_homes_of_a_single_turn_encoder_and_distances_to_the_index_repeat():
    memory = Memory(
        rules(encoder='single_turn', encoder_turn=0.005, home_change_limit=30 * UM), 'c'
    )
    for number, home in enumerate(noise(11, 30), 1):
        memory.add(run(number, home + 0.005 * (number % 3)))
    assert judge(memory, 0.1 + 0.05) == ((), '')
    assert judge(memory, 0.1 + 0.0025).moved
    memory = Memory(rules(home_change_limit=0.001), 'c')
    for number in range(1, 31):  # the switch lies on an index mark
        value = (number % 2) * PITCH + (1 - 2 * (number % 2)) * 1 * UM
        memory.add(run(number, 0.1, pitch=PITCH, quantities={INDEX: (value, 2 * UM)}))
    assert judge(memory, 0.1, quantities={INDEX: (PITCH - 2 * UM, 2 * UM)}) == ((), '')
    assert judge(memory, 0.1, quantities={INDEX: (0.004, 2 * UM)}).moved


def test_quantities_of_a_run():
    hs, limit = 'home_switch', 'positive_limit_switch'
    seen = [
        (hs, True, 1, 0.2001, 9 * UM),
        (hs, False, 1, 0.206, 1 * UM),
        (limit, True, 1, 0.25, 1 * UM),
        (hs, True, -1, 0.2055, 1 * UM),
        (hs, False, -1, 0.199, 1 * UM),
        ('z_pulse', None, 0, 0.203, 0.0),
        (hs, True, 1, 0.2, 2 * UM),
    ]
    found = quantities_of(seen, 0.2, 2 * UM, 1 * UM, 0.004)
    assert found == {
        HOME: (0.2, 2 * UM),
        INDEX: (0.004, 4 * UM),
        FLAG: pytest.approx((0.006, 3 * UM)),
        PLAY: pytest.approx((0.001, 3 * UM)),
        LIMIT: pytest.approx((0.05, 3 * UM)),
    }
    assert quantities_of(seen, None, 0.0, 0.0, None) == {}
    assert set(quantities_of([], 0.2, 0.0, 0.0, None)) == {HOME}


# -- the trends -----------------------------------------------------------------------------------


def found_after(shape, deviation=2 * UM, uncertainty=1e-9, before=40, after=60, seed=0):
    """Return after how many runs the memory told something first, and what it told last."""
    rng = random.Random(seed)
    series, first, last = Series(), None, None
    for number in range(1, before + after + 1):
        since = number - before
        wider, moved = shape(since) if since > 0 else (1.0, 0.0)
        series.add(rng.gauss(0.1, wider * deviation) + moved, uncertainty, number)
        last = trend_of(list(series.values)) or last
        if first is None and (last or series.suspicious >= 2):
            first = since
    return first, last


@pytest.mark.parametrize('uncertainty', [1e-9, 5 * UM])
@pytest.mark.parametrize(
    ('kind', 'shape', 'within'),
    [
        ('step', lambda n: (1.0, 10 * UM), 18),
        ('step', lambda n: (1.0, 50 * UM), 2),
        ('step', lambda n: (1.0, -200 * UM), 2),
        ('step', lambda n: (1.0, PITCH), 2),
        ('drift', lambda n: (1.0, n * UM), 20),
        ('drift', lambda n: (1.0, -n * UM), 20),
        ('alternates', lambda n: (1.0, 20 * UM if n % 2 else 0.0), 14),
        ('spread', lambda n: (4.0, 0.0), 40),
        ('spread', lambda n: (1.0 + 0.1 * n, 0.0), 55),
    ],
)
def test_steps_drifts_two_values_and_wear_are_told_apart(kind, shape, within, uncertainty):
    for seed in range(4):
        first, last = found_after(shape, uncertainty=uncertainty, seed=seed)
        assert last is not None, seed
        assert 0 < first <= within, seed
        assert last.kind == kind, seed


def test_the_size_and_the_begin_of_a_trend():
    _, step = found_after(lambda n: (1.0, 50 * UM))
    assert step.since == 41 and step.size == pytest.approx(50 * UM, rel=0.05)
    _, drift = found_after(lambda n: (1.0, -n * UM))
    assert abs(drift.since - 41) <= 5 and drift.size == pytest.approx(-1 * UM, rel=0.1)
    _, spread = found_after(lambda n: (4.0, 0.0))
    assert abs(spread.since - 41) <= 15 and spread.size == pytest.approx(8 * UM, rel=0.4)
    _, two = found_after(lambda n: (1.0, 20 * UM if n % 2 else 0.0))
    assert two.size == pytest.approx(20 * UM, rel=0.2)


def test_trends_in_words():
    rng = random.Random(0)
    memory = memory_of([0.1 + rng.gauss(0.0, UM) + (PITCH if n >= 40 else 0) for n in range(60)])
    (text,) = memory.trends()
    assert text.startswith('home stepped by +10 mm at run 41 (20')
    assert 'about one pitch of the index' in text
    memory = memory_of([0.1 + rng.gauss(0.0, UM) + UM * max(0, n - 40) for n in range(80)])
    (text,) = memory.trends()
    assert text.startswith('home drifts by ') and ' a run since run ' in text
    assert size_in(text) == pytest.approx(UM, rel=0.1)
    memory = memory_of([0.1 + rng.gauss(0.0, UM * (1 if n < 40 else 6)) for n in range(80)])
    (text,) = memory.trends()
    assert text.startswith('the spread of home has grown to ')
    memory = memory_of([0.1 + rng.gauss(0.0, UM) + 40 * UM * (n % 2) for n in range(30)])
    (text,) = memory.trends()
    assert text.startswith('home alternates between two values 4')


def test_false_alarms_are_rare():
    """1 in 10 000 runs at most; scripts/false_alarms.py counts many more."""
    alarms = 0
    for machine in range(20):
        series = Series()
        for number, value in enumerate(noise(machine, 150), 1):
            series.add(value, 0.5 * UM, number)
            alarms += series.suspicious >= 2 or (
                number % 5 == 0 and trend_of(list(series.values)) is not None
            )
    assert alarms == 0


def test_a_trend_needs_no_more_than_some_runs():
    series = Series()
    for number in range(1, FIRST + 3):
        series.add(0.1 * number, 1e-6, number)
    assert trend_of(list(series.values)) is None
    assert trend_of([]) is None


@pytest.mark.parametrize(
    ('value', 'unit', 'text'),
    [
        (52.13e-6, 'm', '+52.1 µm'),
        (-3.2e-6, 'm', '-3.2 µm'),
        (0.31e-6, 'm', '+0.31 µm'),
        (0.0123, 'm', '+12.3 mm'),
        (999.7e-6, 'm', '+1000 µm'),
        (2.5, 'm', '+2.5 m'),
        (1e-4, 'rad', '+100 µrad'),
        (0.0, 'm', '+0 µm'),
        (3e-9, 'm', '+0.003 µm'),
    ],
)
def test_lengths(value, unit, text):
    assert Unit(unit).length(value, sign=True) == text
    assert Unit(unit).length(abs(value)) == text[1:]
