# SPDX-License-Identifier: Apache-2.0
"""A driver that restarts is noticed by its feedback; a motion is not taken for one."""

import math

import pytest

from homing_node.core.home_watch import HomeWatch

LEAP, STOP = 0.0066, 1.0


def jumps(samples, wrap=0.0, applied=0.0):
    """Return the jumps of a feedback: (time, position) by and by."""
    watch = HomeWatch()
    found = (watch.step(t, p, LEAP, STOP, wrap, applied) for t, p in samples)
    return [jump for jump in found if jump]


def motion(rate, velocity, acceleration, reads=None, end=1.0):
    """Return a motion from rest to a velocity and back; ``reads``: readings per s, if fewer."""
    ramp = velocity / acceleration

    def place(t):
        up = min(max(t - 0.2, 0.0), ramp)
        down = min(max(t - end + ramp, 0.0), ramp)
        steady = max(0.0, min(t, end - ramp) - 0.2 - ramp)
        return (
            0.5 * acceleration * up**2
            + velocity * steady
            + velocity * down
            - 0.5 * acceleration * down**2
        )

    for i in range(int((end + 0.2) * rate)):
        t = i / rate
        yield t, place(math.floor(t * reads) / reads if reads else t)


@pytest.mark.parametrize('velocity', [0.05, 1.0, 3.0])
@pytest.mark.parametrize('acceleration', [2.0, 20.0])
@pytest.mark.parametrize(('rate', 'reads'), [(500, None), (100, None), (50, None), (500, 50)])
def test_no_motion_is_a_jump(rate, reads, velocity, acceleration):
    assert jumps(motion(rate, velocity, acceleration, reads, end=4.0)) == []


@pytest.mark.parametrize('rate', [1000, 500, 100, 50])
@pytest.mark.parametrize('by', [0.05, -0.3])
@pytest.mark.parametrize('velocity', [0.0, 0.1])
def test_a_jump_is_one_at_rest_and_in_motion(rate, by, velocity):
    samples = [(i / rate, velocity * i / rate + by * (i >= rate)) for i in range(2 * rate)]
    assert jumps(samples) == [pytest.approx(by + velocity / rate)]


def test_a_driver_that_loses_its_offset_in_a_pause():
    samples = [(0.002 * i, 0.01) for i in range(100)] + [(0.4 + 0.002 * i, 0.26) for i in range(9)]
    assert jumps(samples) == []  # in 0.2 s an axis may have gone so far
    assert jumps(samples, applied=0.25) == [0.25]


def test_messages_that_are_lost_are_no_jump():
    samples = [(0.002 * i, 0.002 * i) for i in range(500) if i % 100 < 60]
    assert jumps(samples) == []


def test_a_turn_of_wrapped_feedback_is_no_jump():
    turn = 2 * math.pi
    samples = [(0.002 * i, (2.0 * 0.002 * i) % turn) for i in range(4000)]
    assert jumps(samples, wrap=turn) == []
    assert len(jumps(samples)) == 2


def test_noise_of_an_axis_at_rest_hides_no_jump():
    samples = [(0.002 * i, 1e-6 * (i // 30 % 2) + 0.05 * (i > 400)) for i in range(800)]
    (jump,) = jumps(samples)
    assert jump == pytest.approx(0.05, abs=1e-5)


def test_a_run_is_followed_and_what_comes_after_it_is_judged():
    """The run judges its own feedback; the first sample after it is compared with its last one."""
    watch = HomeWatch()
    assert watch.step(0.0, 0.1, LEAP, STOP) == 0.0
    for n in range(1, 11):
        watch.follow(0.01 * n, 0.1 + 0.05 * n)
    assert watch.step(0.11, 0.6, LEAP, STOP) == 0.0
    watch.follow(0.12, 0.6)
    assert watch.step(0.13, 0.1, LEAP, STOP) == pytest.approx(-0.5)
