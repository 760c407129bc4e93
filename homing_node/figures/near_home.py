# SPDX-License-Identifier: Apache-2.0
"""What of a long axis is shown once more, closely: where the run took its home position."""

from collections.abc import Iterable
from dataclasses import replace

from ..course import Course, Sample
from ..plant.layout import AxisLayout

#: A picture that shows less than this, m or rad, is of no long axis.
LONG = 0.5
#: The turns around home are near it within this part of the view, and are seen well enough from
#: that part on.
NEAR, SEEN = 0.1, 0.02
#: The close view is so many times as wide as the way from home to the furthest of these turns.
ROOM = 1.4


def reach_of(course: Course, time: float, span: float) -> float:
    """Return how far from home a close view goes; 0: none is needed.

    Args:
        course: The run.
        time: When it took its home position, s since it began.
        span: What the position diagram shows, m or rad.
    """
    outcome, samples = course.outcome, course.samples
    if outcome is None or not outcome.success or not samples or span < LONG:
        return 0.0
    taken = samples[0].time + time
    before = (one for one in reversed(samples) if one.time <= taken)
    after = (one for one in samples if one.time > taken)
    turns = [
        abs(turn.feedback - outcome.home_position_raw)
        for turn in (_turn(before), _turn(after))
        if turn is not None
    ]
    near = max((one for one in turns if one < NEAR * span), default=0.0)
    return ROOM * near if near < SEEN * span else 0.0


def _turn(samples: Iterable[Sample]) -> Sample | None:
    """Return the last sample before the velocity changes its sign."""
    last: Sample | None = None
    way = 0.0
    for one in samples:
        if way * one.velocity < 0.0:
            return last
        way, last = one.velocity or way, one
    return last


def shifted(course: Course, by: float) -> Course:
    """Return a course whose positions are counted from a place."""
    outcome = course.outcome
    return replace(
        course,
        samples=[
            one._replace(position=one.position - by, feedback=one.feedback - by)
            for one in course.samples
        ],
        happenings=[one._replace(position=one.position - by) for one in course.happenings],
        outcome=outcome and outcome._replace(home_position_raw=outcome.home_position_raw - by),
    )


def layout_from(layout: AxisLayout, by: float) -> AxisLayout:
    """Return a layout whose positions are counted from a place."""
    low, high = layout.hard_stops
    return layout._replace(
        hard_stops=(low - by, high - by),
        switches={
            name: flag._replace(on_from=flag.on_from - by, on_to=flag.on_to - by)
            for name, flag in layout.switches.items()
        },
        index_offset=layout.index_offset - by,
        touch_probe=None if layout.touch_probe is None else layout.touch_probe - by,
    )
