"""Which stamps are believed, and how they relate to the node's clock."""

import time

import pytest

from homing_node.stamps import AGREEMENT, BEHIND, FALLBACK_DOUBT, RETURNED, Stamps
from homing_node.timebase import STANDSTILL, TimeBase

LIMIT = 0.2


def test_a_stamp_is_believed():
    stamps = Stamps(LIMIT)
    assert stamps.believe(10.0, 10.003) == (10.0, 0.0)
    assert stamps.believe(10.1, 10.101) == (10.1, 0.0)
    assert stamps.warning == ''
    assert stamps.replaced == 0
    assert stamps.smallest == pytest.approx(0.001)


@pytest.mark.parametrize(('age', 'believed'), [
    (0.0, True), (BEHIND - 1e-6, True), (LIMIT + 1e-6, False),
    (-AGREEMENT + 1e-6, True), (-AGREEMENT - 1e-6, False), (-3600.0, False), (3600.0, False)])
def test_a_stamp_that_is_too_old_or_in_the_future_is_replaced(age, believed):
    stamps = Stamps(LIMIT)
    used, doubt = stamps.believe(10.0 - age, 10.0)
    assert doubt == (0.0 if believed else FALLBACK_DOUBT)
    assert used == (min(10.0 - age, 10.0) if believed else 10.0)
    assert bool(stamps.warning) is not believed
    assert stamps.replaced == (not believed)


def test_the_time_used_is_never_after_the_arrival():
    assert Stamps(LIMIT).believe(10.0005, 10.0) == (10.0, 0.0)


def test_a_warning_ends_with_its_reason():
    stamps = Stamps(LIMIT)
    stamps.believe(9.0, 10.0)
    assert 'older than 0.2 s' in stamps.warning
    assert stamps.believe(10.1, 10.1) == (10.1, 0.0)
    assert stamps.warning == ''
    assert stamps.replaced == 1


def test_messages_that_overtook_each_other_are_dropped():
    stamps = Stamps(LIMIT, reorder=2)
    assert stamps.believe(10.002, 10.003) == (10.002, 0.0)
    assert stamps.believe(10.001, 10.003) is None
    assert stamps.believe(10.0, 10.003) is None
    assert stamps.believe(10.004, 10.005) == (10.004, 0.0)
    assert stamps.believe(10.001, 10.006) is None  # counted anew


def test_without_reordering_a_backward_stamp_is_a_jump():
    stamps = Stamps(LIMIT)
    assert stamps.believe(10.0, 10.001) == (10.0, 0.0)
    assert stamps.believe(9.95, 10.002) == (10.002, FALLBACK_DOUBT)
    assert 'ran backwards' in stamps.warning


def test_a_clock_that_was_set_back_is_believed_once_it_has_returned():
    """Set back by 0.1 s: within the limit, yet each stamp would be 0.1 s wrong."""
    stamps = Stamps(LIMIT, reorder=2)
    for i in range(10):
        assert stamps.believe(i * 0.002, i * 0.002 + 0.0003) == (i * 0.002, 0.0)
    found = [stamps.believe(i * 0.002 - 0.1, i * 0.002 + 0.0003) for i in range(10, 40)]
    assert found[:2] == [None, None]
    assert found[2:] == [(i * 0.002 + 0.0003, FALLBACK_DOUBT) for i in range(12, 40)]
    assert stamps.believe(1.0, 1.0 + 0.0003 + 0.9 * RETURNED) == (1.0, 0.0)
    assert stamps.smallest == pytest.approx(0.0003)


@pytest.mark.parametrize('behind', [BEHIND, 0.1, LIMIT - 0.002])
def test_a_clock_that_is_behind_is_corrected_and_doubted(behind):
    """Too little for a stamp that is too old: only the quickest message shows it."""
    stamps = Stamps(LIMIT)
    for sent, latency in ((1.0, 0.0015), (1.1, 0.001), (1.2, 0.0012)):
        used, doubt = stamps.believe(sent - behind, sent + latency)
    assert used == pytest.approx(1.2 + 0.001)  # off by the shortest latency
    assert doubt == pytest.approx(behind + 0.001)
    assert f'at least {behind + 0.001:.3f} s' in stamps.warning


def test_one_quick_message_shows_that_the_others_were_slow():
    stamps = Stamps(LIMIT)
    assert stamps.believe(1.0, 1.1)[1] > 0.0
    assert stamps.believe(1.1, 1.101) == (1.1, 0.0)
    assert stamps.believe(1.2, 1.25) == (1.2, 0.0)


def test_a_sample_may_be_older_than_its_message():
    """A driver that samples and sends later says so with its stamps."""
    assert Stamps(LIMIT).believe(1.0, 1.101, sent=1.1) == (1.0, 0.0)


# ----------------------------------------------------------------------------------- timebase

def test_system_stamps_in_monotonic_time():
    clock = TimeBase()
    assert not clock.simulated
    assert not clock.stands
    now = clock.read()
    assert now == clock.now == pytest.approx(time.monotonic(), abs=0.1)
    assert clock.time_of(time.time_ns()) == pytest.approx(time.monotonic(), abs=0.1)
    assert clock.time_of(clock._wall_ns - 5_000_000) == pytest.approx(now - 0.005, abs=1e-9)


def test_a_step_of_the_system_clock_does_no_harm(monkeypatch):
    clock = TimeBase()
    shift = 3_600_000_000_000
    system = time.time_ns
    monkeypatch.setattr(time, 'time_ns', lambda: system() + shift)
    before = clock.now
    assert 0.0 <= clock.read() - before < 1.0
    assert clock.time_of(time.time_ns()) == pytest.approx(clock.now, abs=0.1)


def test_simulated_time():
    ros_time = [5_000_000_000]
    clock = TimeBase(lambda: ros_time[0])
    assert clock.simulated
    assert clock.now == 5.0
    ros_time[0] = 6_000_000_000
    assert clock.now == 5.0
    assert clock.read() == clock.now == 6.0
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


def test_simulated_time_stands(monkeypatch):
    real, simulated = [100.0], [0]
    monkeypatch.setattr(time, 'monotonic', lambda: real[0])
    clock = TimeBase(lambda: simulated[0])
    real[0] += 0.9 * STANDSTILL
    clock.read()
    assert not clock.stands
    real[0] += 0.2 * STANDSTILL
    clock.read()
    assert clock.stands
    simulated[0] += 1
    clock.read()
    assert not clock.stands
