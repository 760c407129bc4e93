# SPDX-License-Identifier: Apache-2.0
"""Two publishers of one joint are noticed, and motions are not taken for them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.core.two_sources import MEMORY, TwoSources

REACH = 0.001


def fed(samples):
    sources = TwoSources()
    for time, position in samples:
        sources.add(time, position, REACH)
    return sources


def merged(one, other):
    return sorted([*one, *other])


@pytest.mark.parametrize('rate', [5.0, 20.0, 50.0, 100.0, 250.0])
def test_a_second_source_at_any_rate_is_noticed(rate):
    """Case 4: the driver at 100 Hz, and a second publisher with another position."""
    driver = [(0.01 * n, 0.12) for n in range(100)]
    second = [(0.003 + n / rate, 0.0) for n in range(int(rate))]
    assert sorted(fed(merged(driver, second)).places) == [0.0, 0.12]


@pytest.mark.parametrize('rate', [20.0, 100.0])
def test_a_second_source_is_noticed_while_the_axis_moves(rate):
    driver = [(0.002 * n, 0.12 + 0.05 * 0.002 * n) for n in range(500)]
    second = [(0.001 + n / rate, 0.0) for n in range(int(rate))]
    assert 0.0 in fed(merged(driver, second)).places


def test_one_disturbed_message_is_no_second_source():
    samples = [(0.01 * n, 0.12) for n in range(100)]
    samples[50] = (0.5, 0.0)
    assert fed(samples).places is None


def test_a_driver_that_restarts_elsewhere_is_no_second_source():
    assert fed([(0.01 * n, 0.12 if n < 50 else 0.0) for n in range(100)]).places is None


def test_two_sources_that_agree_are_none():
    assert fed([(0.005 * n, 0.12 + (n % 2) * 0.5 * REACH) for n in range(200)]).places is None


def test_two_sources_are_forgotten_once_one_has_ended():
    both = merged([(0.01 * n, 0.12) for n in range(100)], [(0.05 * n, 0.0) for n in range(20)])
    sources = fed(both)
    assert sources.places is not None
    for n in range(int(MEMORY * 100) + 20):
        sources.add(1.0 + 0.01 * n, 0.12, REACH)
    assert sources.places is None


@given(
    speed=st.floats(0.0, 0.1),
    amplitude=st.floats(0.0, 0.2),
    period=st.floats(0.1, 10.0),
    noise=st.floats(0.0, 1.0),
)
def test_no_motion_within_reach_is_two_sources(speed, amplitude, period, noise):
    """The axis moves by no more than the reach between two samples."""
    samples, before = [], None
    for n in range(400):
        position = speed * 0.002 * n + amplitude * math.sin(n * 0.002 * 2 * math.pi / period)
        position += noise * 0.2 * REACH * (-1) ** n
        if before is not None:
            position = max(before - 0.99 * REACH, min(before + 0.99 * REACH, position))
        samples.append((0.002 * n, position))
        before = position
    assert fed(samples).places is None
