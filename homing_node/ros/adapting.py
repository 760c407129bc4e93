# SPDX-License-Identifier: Apache-2.0
"""Which subscription fits the publishers of a topic: its type and its QoS; or why none does.

A subscription is as reliable as its least reliable publisher, and asks for earlier messages if
every publisher keeps them. rosbag2 adapts so, too.
"""

from collections.abc import Sequence
from typing import NamedTuple

from ..diagnosis.facts import Endpoint


class Asked(NamedTuple):
    """What a subscription asks for."""

    kind: str
    reliable: bool = True
    latched: bool = False


def adapted(offers: Sequence[Endpoint], default: Asked, told: bool, reliable: bool) -> Asked | str:
    """Return the subscription that fits some publishers, or why there is none.

    Args:
        offers: The publishers, one at least.
        default: What is asked for now, or is asked for as long as nobody publishes.
        told: Whether the user has told the type.
        reliable: Whether lost messages matter.
    """
    kinds = sorted({one.kind for one in offers})
    kind = default.kind
    if kind not in kinds:
        if told:
            return f'{_publish(offers)}, and not {kind}, which the parameter in types says'
        if len(kinds) > 1:
            return f'{_publish(offers)}: which type is it? tell it in types'
        (kind,) = kinds
    fitting = [one for one in offers if one.kind == kind]
    return Asked(
        kind,
        reliable and all(one.reliable for one in fitting),
        all(one.latched for one in fitting),
    )


def mismatch(offers: Sequence[Endpoint], own: Endpoint) -> str:
    """Return why no message of some publishers arrives, '' where it does.

    Args:
        offers: The publishers.
        own: The node's subscription, as it is: with the overrides of the user.
    """
    for one in offers:
        if one.kind != own.kind:
            continue
        if (own.reliable and not one.reliable) or (own.latched and not one.latched):
            return (
                f'{one.node} offers {one.qos}, and the node asks for {own.qos} (qos_overrides): '
                'no message arrives'
            )
        if one.definition and own.definition and one.definition != own.definition:
            return (
                f'{one.node} publishes a {one.kind} with other fields than the one that is '
                'installed here: use one version of its package on both sides'
            )
    return ''


def _publish(offers: Sequence[Endpoint]) -> str:
    return ', '.join(sorted({f'{one.node} publishes {one.kind}' for one in offers}))
