# SPDX-License-Identifier: Apache-2.0
"""What time it is, and how long before its setpoints are due a cycle begins."""

import random
import time
from itertools import pairwise
from types import SimpleNamespace

import pytest

from homing_node.ros.timebase import (
    BLINK,
    LATE_SHARE,
    MOST_LEAD,
    STANDSTILL,
    Lead,
    Stamps,
    TimeBase,
)

PERIOD = 0.004


def test_system_stamps_in_monotonic_time():
    clock = TimeBase()
    assert not clock.simulated
    assert not clock.stands
    now = clock.read()
    assert now == clock.now == pytest.approx(time.monotonic(), abs=0.1)
    assert 0.0 <= clock.elapsed < 0.5
    assert clock.time_of(time.time_ns()) == pytest.approx(time.monotonic(), abs=0.1)
    system = time.time_ns()
    assert clock.time_of(system) - clock.time_of(system - 5_000_000) == pytest.approx(0.005)


def test_a_step_of_the_system_clock_does_no_harm(monkeypatch):
    clock = TimeBase()
    shift = 3_600_000_000_000
    system = time.time_ns
    monkeypatch.setattr(time, 'time_ns', lambda: system() + shift)
    before = clock.now
    assert 0.0 <= clock.read() - before < 1.0
    clock.relate()
    assert clock.time_of(time.time_ns()) == pytest.approx(clock.now, abs=0.1)


def test_clocks_are_related_by_their_closest_readings(monkeypatch):
    """One that was held up between two readings does not shift every stamp."""
    monotonic = iter([100.0, 100.005, 100.005001, 100.009])
    monkeypatch.setattr(time, 'monotonic', lambda: next(monotonic, 200.0))
    clock = TimeBase.__new__(TimeBase)
    clock._ros_time = None
    wall = iter([7_000_000_000, 7_005_000_000, 7_006_000_000])
    monkeypatch.setattr(time, 'time_ns', lambda: next(wall))
    clock.relate()
    assert clock.time_of(7_005_000_000) == pytest.approx(100.005001, abs=1e-6)


def test_simulated_time():
    ros_time = [5_000_000_000]
    clock = TimeBase(lambda: ros_time[0])
    assert clock.simulated
    assert clock.now == 5.0
    ros_time[0] = 6_000_000_000
    assert clock.now == 5.0
    assert clock.elapsed == 1.0
    assert clock.read() == clock.now == 6.0
    assert clock.time_of(5_500_000_000) == 5.5
    assert clock.polled == 5.0
    clock.relate()
    assert clock.polled == 6.0
    assert clock.time_of(5_500_000_000) == 5.5


def test_sleep_until():
    clock = TimeBase()
    due = time.monotonic() + 0.02
    clock.sleep_until(due, lambda: False)
    assert 0.0 <= time.monotonic() - due < 0.5
    clock.sleep_until(due - 10.0, lambda: False)


def test_sleep_in_simulated_time():
    ros_time = [0]

    def advance():
        ros_time[0] += 1_000_000
        return ros_time[0]

    clock = TimeBase(advance)
    clock.sleep_until(0.01, lambda: False)
    assert 0.01 <= clock.now < 0.012
    stopped = TimeBase(lambda: 0)
    asked = []
    stopped.sleep_until(1.0, lambda: len(asked) == 3 or asked.append(0))
    assert stopped.now == 0.0


def test_a_step_back_is_seen_although_another_thread_has_looked():
    ros_time = [100_000_000_000]
    clock = TimeBase(lambda: ros_time[0])
    ros_time[0] = 500_000_000
    clock.relate()
    assert clock.elapsed == -99.5
    clock.sleep_until(100.004, lambda: pytest.fail('waits for the time before'))
    assert clock.now == 0.5


def test_simulated_time_stands(monkeypatch):
    real, simulated = [100.0], [0]
    monkeypatch.setattr(time, 'monotonic', lambda: real[0])
    clock = TimeBase(lambda: simulated[0])

    def look(times):
        for _ in range(times):
            real[0] += 0.5 * BLINK
            clock.read()
        return clock.stands

    assert not look(round(1.8 * STANDSTILL / BLINK))
    assert look(round(0.4 * STANDSTILL / BLINK))
    simulated[0] += 1
    clock.read()
    assert not clock.stands
    real[0] += 10 * STANDSTILL  # we were held up
    clock.read()
    assert not clock.stands
    assert look(round(2.2 * STANDSTILL / BLINK))


# ---------------------------------------------------------------------------------------- lead


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


# -- the stamps of the setpoints ------------------------------------------------------------------


def stamps_of(offsets, period=0.004):
    """Return the stamps of setpoints; the offset between the clocks is read before each, ns."""
    clock = SimpleNamespace(simulated=False, offset=0)
    stamps, given = Stamps(clock), []
    for n, clock.offset in enumerate(offsets):
        given.append(stamps.stamp_of(100.0 + n * period))
    return given


def steps_of(stamps):
    return [b - a for a, b in pairwise(stamps)]


@pytest.mark.parametrize('wrong', [10_000, 2_000_000, -2_000_000, 40_000_000])
def test_a_wrong_reading_of_a_clock_hardly_changes_a_stamp(wrong):
    steps = steps_of(stamps_of([0] * 5 + [wrong] + [0] * 5))
    assert all(abs(step - 4_000_000) <= 4_000 for step in steps)


def test_the_stamps_follow_a_clock_that_is_slewed():
    """500 ppm is the fastest that NTP slews a clock."""
    offsets = [round(n * 4_000_000 * 500e-6) for n in range(2000)]
    stamps = stamps_of(offsets)
    assert abs(stamps[-1] - (round((100.0 + 1999 * 0.004) * 1e9) + offsets[-1])) <= 25_000


def test_the_stamps_follow_a_clock_that_was_set_at_once():
    steps = steps_of(stamps_of([0, 0, 80_000_000, 80_000_000]))
    assert steps == [4_000_000, 84_000_000, 4_000_000]
