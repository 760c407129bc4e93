# SPDX-License-Identifier: Apache-2.0
"""Rules about the feedback: its publishers, its rate, its stamps and its course."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import isfinite, pi
from statistics import median

from ..check.finding import Finding, Severity, up
from ..parameters.axis import AxisParameters
from ..parameters.connections import FEEDBACK
from .facts import Facts, Sample, Topic
from .qos import judge_expression, judge_qos

#: A header stamp that differs by more from the time of sending may be of another clock, s.
STAMP_DOUBT = 0.01
#: A jump that is a turn to within this share of it is a wrap.
TURN, TURN_DOUBT = 2 * pi, 0.02
#: An axis that moves by more than this share of its travel while the doctor listens moves.
MOVED = 1e-3


def judge_feedback(facts: Facts) -> Iterator[Finding]:
    """Yield what is wrong with the feedback of every axis."""
    own, shared = facts.own_feedback, {}
    for joint, (axis, p) in facts.setpoints.axes.items():
        if axis in own:
            yield from judge_expression(axis, FEEDBACK, own[axis])
            yield from _topic(facts, own[axis], {joint: (axis, p)})
        else:
            shared[joint] = axis, p
    if shared:
        yield from _topic(facts, facts.feedback, shared)
    samples = _samples(facts, facts.feedback)
    if facts.setpoints.interface != 'trajectory' and samples:
        for joint in facts.setpoints.joints:
            others = joint not in facts.setpoints.axes
            if others and not any(joint in one.positions for one in samples):
                yield _missing(facts.feedback, samples, '', joint, 'position_joints')


def _samples(facts: Facts, topic: Topic) -> list[Sample]:
    """Return the messages of a topic."""
    return [one for one in facts.samples if one.topic in ('', topic.name)]


def _topic(
    facts: Facts, topic: Topic, axes: Mapping[str, tuple[str, AxisParameters]]
) -> Iterator[Finding]:
    """Judge a topic and the axes whose feedback it has, by their joints."""
    samples = _samples(facts, topic)
    yield from judge_qos('', 'feedback', topic)
    if not topic.publishers:
        yield Finding(
            Severity.error,
            '',
            'no-feedback',
            f'nobody publishes {topic.name}',
            'no run starts (FeedbackStale): is the driver, or the joint_state_broadcaster, '
            'running, and in which namespace?',
        )
        return
    if topic.problem or topic.missing:
        return
    if not samples:
        yield Finding(
            Severity.error,
            '',
            'no-feedback',
            f'no message on {topic.name} within {facts.listened:g} s from '
            f'{", ".join(one.node for one in topic.publishers)}',
            'no run starts (FeedbackStale)',
        )
        return
    for joint, (axis, p) in axes.items():
        own = [one for one in samples if joint in one.positions]
        if own:
            yield from _joint(facts, axis, joint, p, own)
        else:
            yield _missing(topic, samples, axis, joint, 'joint')


def _missing(
    topic: Topic, samples: Sequence[Sample], axis: str, joint: str, parameter: str
) -> Finding:
    """Return that the feedback lacks a joint, which a parameter names."""
    names = sorted({name for one in samples for name in one.positions})
    return Finding(
        Severity.error,
        axis,
        'joint-missing',
        f'{topic.name} has no joint {joint}',
        f'it has {", ".join(names) or "none"}: no run starts (FeedbackStale)',
        parameter,
        joint,
    )


def _joint(
    facts: Facts, axis: str, joint: str, p: AxisParameters, samples: Sequence[Sample]
) -> Iterator[Finding]:
    positions = [one.positions[joint] for one in samples]
    if not all(map(isfinite, positions)):
        yield Finding(
            Severity.error,
            axis,
            'feedback-not-finite',
            f'the position of {joint} is not a finite number in '
            f'{sum(not isfinite(one) for one in positions)} of {len(positions)} messages',
            'such a message is no feedback: FeedbackStale',
        )
        return
    yield from _rate(facts, axis, p, samples)
    yield from _stamps(axis, samples)
    yield from _course(facts, axis, joint, p, positions)


def _rate(
    facts: Facts, axis: str, p: AxisParameters, samples: Sequence[Sample]
) -> Iterator[Finding]:
    gaps = [b.arrival - a.arrival for a, b in pairwise(samples)]
    longest = max(gaps, default=facts.listened)
    if longest > p.feedback_timeout:
        yield Finding(
            Severity.error,
            axis,
            'feedback-gap',
            f'the feedback paused for {longest:.3g} s, feedback_timeout is {p.feedback_timeout:g} '
            's',
            'a run ends with FeedbackStale in such a pause',
            'feedback_timeout',
            p.feedback_timeout,
            up(1.5 * longest),
            's',
        )
    elif gaps and 3 * median(gaps) > p.feedback_timeout:
        yield Finding(
            Severity.warning,
            axis,
            'feedback-rate',
            f'the feedback comes every {median(gaps):.3g} s, feedback_timeout is '
            f'{p.feedback_timeout:g} s',
            'two lost messages end a run with FeedbackStale',
            'feedback_timeout',
            p.feedback_timeout,
            up(5 * median(gaps)),
            's',
        )


def _stamps(axis: str, samples: Sequence[Sample]) -> Iterator[Finding]:
    stamps = [one.stamp for one in samples]
    if not any(stamps):
        yield Finding(
            Severity.info,
            axis,
            'feedback-unstamped',
            'the feedback has no header stamps',
            'the time of sending counts as the time of sampling',
        )
        return
    back = sum(b < a for a, b in pairwise(stamps))
    if back:
        yield Finding(
            Severity.warning,
            axis,
            'feedback-order',
            f'header stamps of the feedback ran backwards {back} times in {len(stamps)} messages',
            'two publishers, or two clocks: such messages are dropped, or cost accuracy',
        )
    if len(samples) > 2 and len(set(stamps)) == 1:
        yield Finding(
            Severity.warning,
            axis,
            'feedback-stamps',
            f'all {len(stamps)} messages of the feedback have the same header stamp',
            'the time of arrival is used instead, which costs accuracy',
        )
        return
    behind = [one.sent - one.stamp for one in samples if one.sent and one.stamp]
    if behind and abs(least := min(behind, key=abs)) > STAMP_DOUBT:
        which = 'behind' if least > 0 else 'ahead of'
        yield Finding(
            Severity.warning,
            axis,
            'feedback-clock',
            f'header stamps are at least {abs(least):.3g} s {which} the sending of the same '
            'message',
            'either the driver samples that early or its clock is another one: a run counts both '
            'into the uncertainty, until the parameter says which it is',
            'feedback_clock',
            right='stamp or arrival',
        )


def _course(
    facts: Facts, axis: str, joint: str, p: AxisParameters, positions: Sequence[float]
) -> Iterator[Finding]:
    steps = [b - a for a, b in pairwise(positions)]
    span = max(positions) - min(positions)
    turns = [one for one in steps if abs(abs(one) - TURN) < TURN_DOUBT * TURN]
    if turns and not getattr(p, 'wrap', 0.0):
        yield Finding(
            Severity.error,
            axis,
            'feedback-wrap',
            f'the position of {joint} jumped by a turn, {abs(turns[0]):.4g}',
            'the driver publishes it modulo a turn: a run ends at the jump',
            'wrap',
            0.0,
            TURN,
            'rad',
        )
        return
    large = MOVED * p.travel
    back_and_forth = sum(
        1 for a, b in pairwise(steps) if a * b < 0 and min(abs(a), abs(b)) > large
    )
    if back_and_forth > 1:
        nodes = ', '.join(one.node for one in facts.feedback.publishers)
        yield Finding(
            Severity.error,
            axis,
            'feedback-doubled',
            f'the position of {joint} jumps between {min(positions):.6g} and {max(positions):.6g}',
            f'no run starts (PublisherConflict): several sources publish it ({nodes})',
        )
        return
    if span > large:
        yield Finding(
            Severity.warning,
            axis,
            'axis-moves',
            f'the axis moved by {span:.3g} while the doctor listened',
            'a request waits until the axis rests',
        )
        moved = sum(1 for one in steps if one)
        if len(steps) > 10 and moved < 0.5 * len(steps):
            yield Finding(
                Severity.warning,
                axis,
                'feedback-staircase',
                f'only {moved} of {len(steps)} messages of a moving axis had a new position',
                'the driver publishes faster than it reads: the time between new positions counts '
                'for the accuracy',
            )
