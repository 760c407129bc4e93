"""What time it is, and how long before its setpoints are due a cycle begins."""

import random
import time

import pytest

from homing_node.timebase import LATE_SHARE, MOST_LEAD, Lead, TimeBase

PERIOD = 0.004


def late(lead, work, cycles):
    """Run some cycles whose work takes ``work()`` s; return the share of those that were late."""
    count = 0
    for _ in range(cycles):
        missed = work() > lead.time
        lead.learn(missed)
        count += missed
    return count / cycles


@pytest.mark.parametrize('work', [2e-4, 1e-3])
def test_few_setpoints_are_late(work):
    chance = random.Random(1)
    lead = Lead(PERIOD)
    late(lead, lambda: chance.gauss(work, 0.1 * work), 2000)
    share = late(lead, lambda: chance.gauss(work, 0.1 * work), 20_000)
    assert share == pytest.approx(LATE_SHARE, abs=0.005)
    assert work < lead.time < 1.4 * work


def test_a_lead_follows_work_that_becomes_less():
    lead = Lead(PERIOD)
    late(lead, lambda: 1e-3, 2000)
    assert lead.time == pytest.approx(1e-3, rel=0.02)
    late(lead, lambda: 2e-4, 5000)
    assert lead.time == pytest.approx(2e-4, rel=0.1)


def test_the_bounds_of_a_lead():
    lead = Lead(PERIOD)
    late(lead, lambda: 1.0, 5000)
    assert lead.time == MOST_LEAD * PERIOD
    late(lead, lambda: -1.0, 20_000)
    assert lead.time == 0.0


def test_simulated_time_is_that_of_the_last_reading():
    times = iter([0, 100_000_000_000, 100_250_000_000])
    clock = TimeBase(lambda: next(times))
    assert clock.now == 0.0
    assert clock.read() == clock.now == 100.0
    assert clock.time_of(99_500_000_000) == 99.5
    assert clock.read() == 100.25
    assert clock.time_of(99_500_000_000) == 99.5
    assert not clock.stands


def test_stamps_fit_the_core_whatever_the_clocks_are():
    clock = TimeBase()
    now = clock.read()
    system = time.time_ns()
    assert now <= clock.time_of(system) <= time.monotonic()
