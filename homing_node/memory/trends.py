# SPDX-License-Identifier: Apache-2.0
"""What the values of many runs do: nothing, a step, a drift, a growing spread, two values.

The first REFERENCE values are the reference: their median, and their spread (no less than the
uncertainty). A mean that forgets (EWMA) finds a drift, a sum of what is beyond a small change
(CUSUM) finds a step. Which of them it is, the better fit says. The limits are wider than those of
textbooks, whose charts are wrong once in some hundred runs: doc/memory.md has what they cost.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import sqrt
from statistics import fmean, median, pstdev
from typing import NamedTuple

from .series import NORMAL, Value

#: Values of the reference, and of the newest values that a spread is computed from.
REFERENCE, NEWEST = 30, 20
#: The part of a new value in the mean that forgets, and how many of its deviations are too many.
FORGETS, DRIFTED = 0.2, 8.0
#: What a sum leaves out of each value, and when it is too large; scales.
LEFT_OUT, STEPPED = 1.0, 14.0
#: One value counts no more than this, scales: one outlier is no trend.
OUTLIER = 3.0
#: How many times the spread of the reference is a grown spread.
GROWN = 3.0
#: The largest differences that do not count for a spread: outliers, and a step.
LEFT_OUT_OF_SPREAD = 2
#: A series alternates if it changes sides this often in the newest values, and has this many on
#: each side.
SIDES_CHANGED, ON_EACH_SIDE = 6, 5
#: The two values are further apart than this many times the deviation of each.
APART = 7.0


class Trend(NamedTuple):
    """What the values do.

    Attributes:
        kind: `step`, `drift`, `spread` or `alternates`.
        since: The number of the run with which it began.
        size: Of a step its size, of a drift its size in each run, of two values their distance, m
            or rad; of a spread the spread of the newest values.
    """

    kind: str
    since: int
    size: float


def trend_of(values: Sequence[Value]) -> Trend | None:
    """Return what the values of a series do, None if they do nothing or are too few."""
    alternation = _alternation(values)
    if alternation is not None or len(values) < REFERENCE:
        return alternation
    reference = values[:REFERENCE]
    centre = median(one.value for one in reference)
    least = median(one.uncertainty for one in reference)
    spread = NORMAL * median(abs(one.value - centre) for one in reference)
    scale = max(spread + 0.5 * least, _deviation(reference), least)
    return _moved(values, centre, scale) or _spread(values, least)


def _moved(values: Sequence[Value], centre: float, scale: float) -> Trend | None:
    """Return the step or the drift that the sums and the mean have found."""
    mean = up = down = 0.0
    found = False
    for one in values:
        z = max(-OUTLIER, min(OUTLIER, (one.value - centre) / scale))
        mean += FORGETS * (z - mean)
        up = max(0.0, up + z - LEFT_OUT)
        down = max(0.0, down - z - LEFT_OUT)
        limit = DRIFTED * (FORGETS / (2.0 - FORGETS)) ** 0.5
        found = abs(mean) > limit or max(up, down) > STEPPED
    return _better_fit(values) if found else None


def _better_fit(values: Sequence[Value]) -> Trend:
    """Return the step or the ramp that fits better, with the run in which it begins.

    Both begin after a level stretch. Each is fitted for every beginning, from sums that grow by a
    value at a time.
    """
    middle = values[0].value  # keeps the sums small
    places = [one.value - middle for one in values]
    step_gain, at, size = max(_steps(places))
    ramp_gain, start, slope = max(_ramps(places))
    if step_gain >= ramp_gain:
        return Trend('step', values[at].run, size)
    return Trend('drift', values[start + 1].run, slope)


def _steps(places: Sequence[float]) -> Iterator[tuple[float, int, float]]:
    """Yield what each step explains of the sum of squares, its first value, its size."""
    count, whole, before = len(places), sum(places), 0.0
    for at in range(1, count):
        before += places[at - 1]
        size = (whole - before) / (count - at) - before / at
        yield size**2 * at * (count - at) / count, at, size


def _ramps(places: Sequence[float]) -> Iterator[tuple[float, int, float]]:
    """Yield the same of each line that is level until a value, with its slope."""
    count, mean = len(places), fmean(places)
    behind = weighted = 0.0  # sums of the values behind the beginning, plain and by distance
    for start in range(count - 2, -1, -1):
        behind += places[start + 1]
        weighted += behind
        steps = count - 1 - start
        times = 0.5 * steps * (steps + 1)
        square = times * (2 * steps + 1) / 3.0 - times**2 / count
        product = weighted - times * mean
        if steps > 2:
            yield product**2 / square, start, product / square


def _alternation(values: Sequence[Value]) -> Trend | None:
    """Return the two values between which the newest ones alternate, if they do."""
    newest = values[-NEWEST:]
    places = sorted(one.value for one in newest)
    if len(places) < 2 * ON_EACH_SIDE:
        return None
    _, at = max((high - low, i + 1) for i, (low, high) in enumerate(pairwise(places)))
    low, high = places[:at], places[at:]
    if min(len(low), len(high)) < ON_EACH_SIDE:
        return None
    spread = sqrt(0.5 * (pstdev(low) ** 2 + pstdev(high) ** 2))
    within = max(spread, 0.3 * max(one.uncertainty for one in newest))
    if fmean(high) - fmean(low) <= APART * within:
        return None
    sides = [one.value >= high[0] for one in newest]
    if sum(one != other for one, other in pairwise(sides)) < SIDES_CHANGED:
        return None
    changed = next(i for i, side in enumerate(sides) if side != sides[0])
    return Trend('alternates', newest[changed].run, fmean(high) - fmean(low))


def _spread(values: Sequence[Value], least: float) -> Trend | None:
    """Return the spread of the newest values if it has grown; a step or a drift does not count."""
    if len(values) < REFERENCE + NEWEST:
        return None
    before = max(_deviation(values[:REFERENCE]), 0.2 * least)
    now = _deviation(values[-NEWEST:])
    if now <= GROWN * before:
        return None
    begin = next(
        i
        for i in range(REFERENCE, len(values))
        if i + NEWEST >= len(values) or _deviation(values[i : i + NEWEST]) > GROWN * before
    )
    return Trend('spread', values[begin].run, now)


def _deviation(values: Sequence[Value]) -> float:
    """Return the standard deviation, from the differences of neighbours."""
    squares = sorted((b.value - a.value) ** 2 for a, b in pairwise(values))
    kept = squares[: len(squares) - LEFT_OUT_OF_SPREAD]
    return (0.5 * fmean(kept)) ** 0.5 if kept else 0.0
