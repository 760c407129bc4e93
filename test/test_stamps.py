# SPDX-License-Identifier: Apache-2.0
"""Which stamps are believed."""

import pytest

from homing_node.core.stamps import AGREEMENT, BEHIND, FALLBACK_DOUBT, RETURNED, Stamps
from homing_node.procedures.states import FeedbackClock

LIMIT = 0.2


def test_a_stamp_is_believed():
    stamps = Stamps(LIMIT)
    assert stamps.believe(10.0, 10.003) == (10.0, 0.0)
    assert stamps.believe(10.1, 10.101) == (10.1, 0.0)
    assert stamps.warning == ''
    assert stamps.replaced == 0
    assert stamps.smallest == pytest.approx(0.001)


@pytest.mark.parametrize(
    ('age', 'believed'),
    [
        (0.0, True),
        (BEHIND - 1e-6, True),
        (LIMIT + 1e-6, False),
        (-AGREEMENT + 1e-6, True),
        (-AGREEMENT - 1e-6, False),
        (-3600.0, False),
        (3600.0, False),
    ],
)
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


@pytest.mark.parametrize('lag', [0.05, 0.1, 0.2, 0.9])
def test_a_header_behind_its_message_has_two_readings(lag):
    """A slow sampling, or another clock: the doubt covers both."""
    stamps = Stamps(LIMIT)
    for sent in (1.0, 1.01, 1.02):
        time, doubt = stamps.believe(sent - lag, sent + 0.001, sent)
        assert time - doubt <= sent - lag + 1e-9
        assert time + doubt >= sent - 1e-9
        assert doubt <= 0.5 * lag + 1e-9
    assert f'{lag:.3f} s behind' in stamps.warning
    assert 'feedback_clock' in stamps.warning


def test_a_header_ahead_of_its_message_is_of_another_clock():
    stamps = Stamps(LIMIT)
    assert stamps.believe(1.2, 1.001, sent=1.0) == (1.0, FALLBACK_DOUBT)
    assert '0.200 s ahead' in stamps.warning


def test_a_header_that_is_hours_behind_is_of_another_clock():
    assert Stamps(LIMIT).believe(1.0, 3600.0, sent=3600.0) == (3600.0, FALLBACK_DOUBT)


def test_one_prompt_message_shows_that_the_header_is_the_sampling_time():
    stamps = Stamps(LIMIT)
    assert stamps.believe(1.0, 1.031, sent=1.03)[1] == pytest.approx(0.015)
    assert stamps.believe(2.0, 2.006, sent=2.005) == (2.0, 0.0)
    assert stamps.warning == ''
    assert stamps.believe(3.0, 3.031, sent=3.03) == (3.0, 0.0)


@pytest.mark.parametrize(
    ('clock', 'lag', 'time'),
    [
        (FeedbackClock.arrival, 0.1, 1.0),
        (FeedbackClock.arrival, -0.1, 1.0),
        (FeedbackClock.stamp, 0.1, 0.9),
    ],
)
def test_the_user_may_say_which_reading_is_right(clock, lag, time):
    stamps = Stamps(LIMIT)
    assert stamps.believe(1.0 - lag, 1.001, 1.0, clock) == (time, 0.0)
    assert stamps.warning == ''


def test_a_clock_of_which_a_message_was_too_late_is_one_that_disagrees():
    """Only the first message is a late one; the next is as old because of the clock."""
    stamps = Stamps(limit=0.2)
    assert stamps.believe(1.0, 1.001) == (1.0, 0.0)
    assert stamps.believe(2.0, 2.5) == (2.5, FALLBACK_DOUBT)
    assert stamps.late == pytest.approx(0.499)
    assert stamps.believe(3.0, 3.5) == (3.5, FALLBACK_DOUBT)
    assert stamps.late == 0.0
