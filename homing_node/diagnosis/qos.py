# SPDX-License-Identifier: Apache-2.0
"""Rules about messages that do not reach the node, or do not say what it wants to know."""

from collections.abc import Iterator

from ..check.finding import Finding, Severity
from .facts import Topic


def judge_qos(axis: str, source: str, topic: Topic) -> Iterator[Finding]:
    """Yield what keeps the messages of an input from the node: type, reliability, durability."""
    own = topic.subscription
    if own is None:
        return
    for one in topic.publishers:
        if own.kind and one.kind and own.kind != one.kind:
            yield Finding(
                Severity.error,
                axis,
                'type',
                f'{topic.name}: {one.node} publishes {one.kind}, the node expects {own.kind}',
                f'no message of {source} arrives',
            )
        elif (own.reliable and not one.reliable) or (own.latched and not one.latched):
            yield Finding(
                Severity.error,
                axis,
                'qos',
                f'{topic.name}: {one.node} publishes {one.qos}, the node asks for {own.qos}',
                f'no message of {source} arrives',
                f'qos_overrides.{topic.name}.subscription.'
                + ('reliability' if own.reliable and not one.reliable else 'durability'),
                right='best_effort' if own.reliable and not one.reliable else 'volatile',
            )
        elif one.latched and not own.latched and not topic.heard.arrivals:
            yield Finding(
                Severity.warning,
                axis,
                'qos-latched',
                f'{topic.name}: {one.node} publishes {one.qos}, the node asks for {own.qos}',
                f'a value of {source} that was published before the node started is not heard',
                f'qos_overrides.{topic.name}.subscription.durability',
                right='transient_local',
            )


def judge_expression(axis: str, source: str, topic: Topic) -> Iterator[Finding]:
    """Yield why the messages of a topic do not say an input."""
    if topic.problem:
        yield Finding(
            Severity.error,
            axis,
            'expression',
            f'{topic.signal}: {topic.problem}',
            f'{source} cannot be read, and no run starts (InvalidParameter)',
            f'topics.{source}',
            topic.signal,
        )
    elif topic.missing:
        yield Finding(
            Severity.error,
            axis,
            'value-missing',
            f'{topic.signal}: {topic.missing}',
            f'{source} is not known, and no run starts',
            f'topics.{source}',
            topic.signal,
        )
