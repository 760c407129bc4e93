# SPDX-License-Identifier: Apache-2.0
"""How far an axis goes on before it rests or has turned: closed forms of the jerk-limited stop.

The same trajectories that core/phase.py lets ruckig compute, as formulas; all arguments and
results are positive. Units: m or rad, s.
"""

from collections.abc import Callable
from math import sqrt


def stopping_distance(velocity: float, deceleration: float, jerk: float) -> float:
    """Return how far a stop from a constant velocity takes, or the way to it from rest."""
    peak = min(deceleration, sqrt(velocity * jerk))
    return velocity / 2 * (velocity / peak + peak / jerk)


def turning_distance(
    velocity: float,
    back: float,
    acceleration: float,
    deceleration: float,
    jerk: float,
    back_acceleration: float | None = None,
) -> float:
    """Return how far a reversal goes on, from a constant velocity to ``back`` the other way.

    It is one trajectory through zero with the lesser of acceleration and deceleration; where the
    motion back accelerates more gently than that, the axis stops first.
    """
    limit = min(acceleration, deceleration)
    if back_acceleration is not None and back_acceleration < limit:
        return stopping_distance(velocity, limit, jerk)
    change = velocity + back
    peak = min(limit, sqrt(change * jerk))
    ramp = peak / jerk
    constant = change / peak - ramp
    left = velocity - peak * ramp / 2
    if left <= 0.0:  # it turns while the deceleration still grows
        time = sqrt(2 * velocity / jerk)
        return velocity * time - jerk * time**3 / 6
    gone = velocity * ramp - jerk * ramp**3 / 6
    if left <= peak * constant:
        return gone + left * left / (2 * peak)
    gone += left * constant - peak * constant**2 / 2
    left -= peak * constant  # it turns while the deceleration already shrinks
    ramped, low, high = 0.0, 0.0, ramp
    for _ in range(60):
        ramped = (low + high) / 2
        if left - peak * ramped + jerk * ramped**2 / 2 > 0.0:
            low = ramped
        else:
            high = ramped
    return gone + left * ramped - peak * ramped**2 / 2 + jerk * ramped**3 / 6


def reaction_distance(velocity: float, acceleration: float, jerk: float, delay: float) -> float:
    """Return how far the axis goes before it brakes, ``delay`` s after it met what stops it.

    The worst case is not the constant velocity: an axis that meets a switch just before it has
    reached its velocity must first take its acceleration back.
    """
    peak = min(acceleration, sqrt(velocity * jerk))
    time = peak / jerk
    before = velocity - peak * time / 2
    return max(velocity * delay, velocity * time - jerk * time**3 / 6 + before * delay)


def fastest(distance: Callable[[float], float], room: float, at_most: float) -> float:
    """Return the largest velocity, up to a given one, whose distance stays within a room."""
    low, high = 0.0, at_most
    for _ in range(60):
        middle = (low + high) / 2
        if distance(middle) <= room:
            low = middle
        else:
            high = middle
    return low
