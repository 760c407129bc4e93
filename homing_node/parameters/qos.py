# SPDX-License-Identifier: Apache-2.0
"""Which policies of QoS may be overridden, and with what.

By parameters ``qos_overrides.<topic>.<subscription|publisher>.<policy>``, as of every ROS node.
"""

import re
from collections.abc import Mapping
from dataclasses import replace

from ..procedures.states import TextEnum
from .definition import Definition, suggestion, table

NAME = re.compile(r'qos_overrides\.[^.]+\.(subscription|publisher)\.(?P<policy>[^.]+)')


class History(TextEnum):
    """Which messages are kept."""

    keep_last = 'keep_last'
    keep_all = 'keep_all'
    system_default = 'system_default'


class Reliability(TextEnum):
    """Whether a message that was lost is sent again."""

    reliable = 'reliable'
    best_effort = 'best_effort'
    best_available = 'best_available'
    system_default = 'system_default'


class Durability(TextEnum):
    """Whether a late joiner receives what was published before."""

    volatile = 'volatile'
    transient_local = 'transient_local'
    best_available = 'best_available'
    system_default = 'system_default'


POLICIES: Mapping[str, Definition] = table(
    Definition('which messages are kept', History, name='history'),
    Definition('how many messages are kept', int, 'messages', 1, 2**31 - 1, name='depth'),
    Definition('whether a lost message is sent again', Reliability, name='reliability'),
    Definition(
        'whether a late joiner receives what was published before',
        Durability,
        name='durability',
    ),
)


def check_override(name: str, value: object) -> None:
    """Check one parameter of ``qos_overrides``; raises ValueError that says what is wrong."""
    found = NAME.fullmatch(name)
    if found is None:
        raise ValueError(f'{name}: is not qos_overrides.<topic>.<subscription|publisher>.<policy>')
    policy = found['policy']
    if policy not in POLICIES:
        raise ValueError(
            f'{name}: {policy!r} is none of {", ".join(POLICIES)}' + suggestion(policy, POLICIES)
        )
    definition = replace(POLICIES[policy], name=name)
    definition.convert(value.lower() if isinstance(value, str) else value)  # as rclpy reads it
