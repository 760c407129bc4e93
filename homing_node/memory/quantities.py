# SPDX-License-Identifier: Apache-2.0
"""The quantities of a run that are compared with those of other runs.

Positions are raw, m or rad; a way is the sign of the travel relative to the homing direction.
"""

from collections.abc import Mapping, Sequence

from ..procedures.states import LIMIT_SWITCHES, Input

#: The raw home, and the distances between things of the machine.
HOME = 'home'
INDEX = 'the distance from the switch to the index'
FLAG = 'the width of the flag'
LIMIT = 'the distance from the home switch to the limit switch'
PLAY = 'the distance between on and off of the switch'

#: (input, rises, way, position, uncertainty); of a latch, rises is None.
Seen = tuple[str, bool | None, int, float, float]


def quantities_of(
    seen: Sequence[Seen],
    home: float | None,
    uncertainty: float,
    resolution: float,
    to_index: float | None,
) -> Mapping[str, tuple[float, float]]:
    """Return each quantity of a run with its uncertainty.

    Args:
        seen: Every edge and latch of the run.
        home: Where home was found; None if it was not.
        uncertainty: How far that may be off.
        resolution: The finest difference that the feedback can show.
        to_index: The distance from the edge that armed the index to the index; None: there is
            none.
    """
    if home is None:
        return {}
    found = {HOME: (home, max(uncertainty, resolution))}
    if to_index is not None:
        found[INDEX] = to_index, 2.0 * max(uncertainty, resolution)
    newest: dict[tuple[str, bool | None, int], tuple[float, float]] = {}
    for name, rises, way, position, unsure in seen:
        newest[name, rises, way] = position, max(unsure, resolution)
    switch = str(Input.HOME_SWITCH)
    on = newest.get((switch, True, 1))
    limits = [newest[str(one), True, 1] for one in LIMIT_SWITCHES if (str(one), True, 1) in newest]
    for quantity, other in (
        (FLAG, newest.get((switch, False, 1))),
        (PLAY, newest.get((switch, False, -1))),
        (LIMIT, limits[0] if limits else None),
    ):
        if on is not None and other is not None:
            found[quantity] = abs(other[0] - on[0]), on[1] + other[1]
    return found
