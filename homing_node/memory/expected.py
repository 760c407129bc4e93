# SPDX-License-Identifier: Apache-2.0
"""How long the next run of an axis takes, from its last ones."""

import math
from collections.abc import Sequence
from statistics import median

from .records import Run

#: So many of the newest runs are looked at.
NEWEST = 5


def longest(durations: Sequence[float]) -> float:
    """Return how long runs take that begin together, s; NaN if one of them is not known."""
    return math.nan if any(map(math.isnan, durations)) else max(durations, default=0.0)


def expected_duration(runs: Sequence[Run], fast: float, slow: float) -> float:
    """Return the median duration of the newest homings with the present velocities, s.

    Returns:
        NaN if there is none: nothing is guessed.
    """
    like = [
        run.duration
        for run in runs
        if run.home is not None and run.kind != 'verify' and (run.fast, run.slow) == (fast, slow)
    ]
    return median(like[-NEWEST:]) if like else math.nan
