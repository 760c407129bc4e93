# SPDX-License-Identifier: Apache-2.0
"""Which times the messages of a switch leave open for an edge."""

import importlib.util
import random
from pathlib import Path

import pytest

from homing_node.core.edge_time import LONGEST_GAP, MessageTimes


def heard(period, count=20, jitter=0.0, seed=0):
    """Return the messages of a driver that repeats the level, and the newest one's time."""
    chance = random.Random(seed)
    messages, time = MessageTimes(), 0.0
    messages.first(time, 0.0)
    for _ in range(count):
        time += period * (1.0 + chance.uniform(-jitter, jitter))
        messages.repeat(time, 0.0)
    return messages, time


def test_a_driver_that_was_silent_for_long_publishes_on_change():
    messages = MessageTimes()
    messages.first(0.0, 0.0)
    opening = messages.change(1.1 * LONGEST_GAP, 0.001)
    assert opening.gap == 0.0
    assert opening.middle == 1.1 * LONGEST_GAP
    assert opening.doubt == 0.001
    assert messages.on_change
    assert messages.change(1.1 * LONGEST_GAP + 0.05, 0.0).gap == 0.0  # once is enough


def test_a_change_soon_after_the_first_message_is_open():
    messages = MessageTimes()
    messages.first(0.0, 0.0)
    opening = messages.change(0.1, 0.0)
    assert (opening.begin, opening.end, opening.middle) == (0.0, 0.1, 0.05)


@pytest.mark.parametrize('jitter', [0.0, 0.3])
@pytest.mark.parametrize('period', [0.001, 0.02, 0.2])
def test_a_polled_switch_is_never_taken_for_one_on_change(period, jitter):
    """With jitter, and with every hundredth message lost."""
    chance = random.Random(1)
    messages, newest = heard(period, jitter=jitter)
    for _ in range(3000):
        time = newest + period * (1.0 + chance.uniform(-jitter, jitter))
        if chance.random() < 0.01:
            time += period
        if chance.random() < 0.1:
            opening = messages.change(time, 0.0)
            assert opening.begin == pytest.approx(newest)
            assert opening.end == time
        else:
            messages.repeat(time, 0.0)
        newest = time
    assert not messages.on_change


@pytest.mark.parametrize('period', [0.1, 0.5, 2.0])
def test_a_heartbeat_is_found_by_a_change_that_comes_early(period):
    messages, time = heard(period)
    assert messages.change(time + 0.3 * period, 0.0).gap == 0.0
    assert messages.on_change


def test_a_quick_loop_that_was_held_up_keeps_its_gap():
    """It catches up early; that shows a driver on change, but not for this edge."""
    messages, time = heard(0.02)
    assert messages.change(time + 0.008, 0.0).gap == pytest.approx(0.008)
    messages.repeat(time + 0.028, 0.0)
    assert messages.change(time + 0.048, 0.0).gap == pytest.approx(0.02)


def test_a_repeat_that_comes_early_after_a_change_shows_a_heartbeat():
    messages, time = heard(0.5)
    assert messages.change(time + 0.4, 0.0).gap == pytest.approx(0.4)  # not known yet
    messages.repeat(time + 0.5, 0.0)
    assert messages.on_change
    messages.repeat(time + 1.0, 0.0)
    assert messages.change(time + 1.4, 0.0).gap == 0.0


@pytest.mark.parametrize('since', ['a repeat', 'a change'])
def test_a_change_that_the_heartbeat_shows_is_open(since):
    """The message of the change may be lost."""
    messages, time = heard(0.5)
    messages.change(time + 0.1, 0.0)
    assert messages.on_change
    if since == 'a repeat':
        messages.repeat(time + 0.5, 0.0)
        assert messages.change(time + 1.0, 0.0).gap == pytest.approx(0.5)
    else:
        assert messages.change(time + 0.5, 0.0).gap == pytest.approx(0.4)


def test_repeats_that_have_ceased_say_nothing():
    messages, time = heard(0.01, count=5)
    assert messages.change(time + 30.0, 0.0).gap == 0.0


def test_the_worse_of_two_doubts_counts_if_both_messages_do():
    messages = MessageTimes()
    messages.first(0.0, 0.02)
    assert messages.change(0.1, 0.001).doubt == 0.02


def test_time_that_is_set_back_opens_no_gap_of_hours():
    messages, _ = heard(0.1)
    messages.set_back(-100.0)
    assert messages.change(-99.95, 0.0).gap == pytest.approx(0.05)


def test_the_figure_is_generated():
    root = Path(__file__).resolve().parent.parent
    spec = importlib.util.spec_from_file_location('edges_page', root / 'scripts' / 'edges.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (root / 'doc' / 'edges.svg').read_text() == module.svg(module.recorded())
