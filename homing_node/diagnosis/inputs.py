# SPDX-License-Identifier: Apache-2.0
"""Rules about the switches and latches: who publishes them, how often, by which clock."""

from collections.abc import Iterator
from statistics import median

from ..check.finding import Finding, Severity, down, up
from ..parameters.axis import AxisParameters
from ..procedures.states import LATCHES, Input
from .facts import Facts, Topic
from .qos import judge_expression, judge_qos

#: A polled switch that leaves the edge open by more than this costs accuracy, m.
FINE = 1e-4
#: An arrival that seems earlier than its sending by more than this is of another clock, s.
EARLY = 0.001
#: A message that seems to travel for longer than this comes from another clock, or is late, s.
LATE = 0.02


def judge_inputs(facts: Facts) -> Iterator[Finding]:
    """Yield what is wrong with the inputs of every axis."""
    parameters = dict(facts.setpoints.axes.values())
    for (axis, source), topic in facts.inputs.items():
        yield from judge_qos(axis, source, topic)
        yield from judge_expression(axis, source, topic)
        yield from _publishers(axis, source, topic)
        if topic.publishers and source not in LATCHES and source is not Input.SERVO_ENABLED:
            yield from _rate(axis, source, topic, parameters[axis], facts.listened)
    yield from _clocks(facts)


def _publishers(axis: str, source: Input, topic: Topic) -> Iterator[Finding]:
    names = ', '.join(sorted(one.node for one in topic.publishers))
    if not topic.publishers:
        yield Finding(
            Severity.error,
            axis,
            'no-publisher',
            f'nobody publishes {source} ({topic.name})',
            'no run starts (SwitchUnknown): is the driver running, and is this its topic?',
            f'topics.{source}',
        )
    elif len(topic.publishers) > 1:
        yield Finding(
            Severity.error,
            axis,
            'publishers',
            f'{len(topic.publishers)} publishers on {topic.name}: {names}',
            f'no run starts (PublisherConflict): which one tells {source}? (one that was killed '
            'stays listed for about 20 s)',
        )


def _rate(
    axis: str, source: Input, topic: Topic, p: AxisParameters, listened: float
) -> Iterator[Finding]:
    heard = topic.heard
    changes = sum(a != b for a, b in zip(heard.values, heard.values[1:], strict=False))
    polled = len(heard.gaps) > 2 and len(heard.arrivals) > 2 * (changes + 1)
    if not polled:
        if 0.0 < p.switch_timeout < listened:
            yield Finding(
                Severity.error,
                axis,
                'switch-timeout',
                f'{source} was published {len(heard.arrivals)} times in {listened:g} s, '
                f'switch_timeout is {p.switch_timeout:g} s',
                'a driver that publishes on change only is silent for longer: SwitchStale',
                'switch_timeout',
                p.switch_timeout,
                0.0,
                's',
            )
        return
    gap = median(heard.gaps)
    if 0.0 < p.switch_timeout < max(heard.gaps):
        yield Finding(
            Severity.error,
            axis,
            'switch-timeout',
            f'{source} paused for {max(heard.gaps):.3g} s, switch_timeout is '
            f'{p.switch_timeout:g} s',
            'a run ends with SwitchStale in such a pause',
            'switch_timeout',
            p.switch_timeout,
            up(3 * max(heard.gaps)),
            's',
        )
    open_length = 0.5 * gap * p.homing_velocity_slow
    if open_length > FINE:
        yield Finding(
            Severity.warning,
            axis,
            'switch-polled',
            f'{source} is published every {gap:.3g} s, changed or not',
            f'an edge lies between two messages: {open_length:.3g} at homing_velocity_slow is '
            'left open',
            'homing_velocity_slow',
            p.homing_velocity_slow,
            down(2 * FINE / gap),
            'm/s',
        )
    else:
        yield Finding(
            Severity.info,
            axis,
            'switch-rate',
            f'{source} is published at {1.0 / gap:.4g} Hz, changed or not',
            f'an edge is left open by {open_length:.2g} at homing_velocity_slow',
        )


def _clocks(facts: Facts) -> Iterator[Finding]:
    """Judge the clocks of the hosts by the messages that travelled fastest."""
    for topic in {
        one.name: one
        for one in [facts.feedback, *facts.own_feedback.values(), *facts.inputs.values()]
    }.values():
        delay = topic.heard.delay
        if delay is None or -EARLY <= delay <= LATE:
            continue
        nodes = ', '.join(one.node for one in topic.publishers)
        seems = (
            f'arrive {-delay:.3g} s before they were sent'
            if delay < 0
            else f'arrive {delay:.3g} s after they were sent'
        )
        yield Finding(
            Severity.warning,
            '',
            'clock',
            f'messages on {topic.name} ({nodes}) {seems}',
            'the clocks of the two hosts disagree, or the network is slow; a controller with '
            'such a clock plays stamped setpoints too early or too late: let chrony or ptp set '
            'the clocks',
            'setpoint_stamp',
            right='zero',
        )
