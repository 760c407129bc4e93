# SPDX-License-Identifier: Apache-2.0
"""Who judges the stamps of one publisher alike: one judgement for all of them."""

from collections.abc import Hashable, Iterable
from copy import copy
from typing import NamedTuple, TypeVar

from ..core.stamps import Stamps

Member = TypeVar('Member')


class Judging(NamedTuple):
    """How stamps are judged: see the arguments of `Stamps`."""

    limit: float
    clock: str
    reorder: int


def grouped(
    members: Iterable[tuple[Hashable, Judging, Member]], known: dict[Hashable, Stamps]
) -> list[tuple[Stamps, list[Member]]]:
    """Group members that judge stamps alike.

    Args:
        members: Who judges, how, and what is to be grouped.
        known: The stamps that each judge last judged by; what is known of them stays.
    """
    groups: dict[Judging, tuple[Stamps, list[Member]]] = {}
    for judge, judging, member in members:
        if judging not in groups:
            stamps = copy(known.get(judge) or Stamps(judging.limit, judging.reorder))
            stamps.limit, stamps.clock = judging.limit, judging.clock
            groups[judging] = stamps, []
        stamps, alike = groups[judging]
        alike.append(member)
        known[judge] = stamps
    return list(groups.values())
