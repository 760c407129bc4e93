# SPDX-License-Identifier: Apache-2.0
"""The colours of all pictures; the colour-blind tell them apart, and so does a grey print."""

from ..procedures.states import State

# Okabe and Ito's palette, and darker ones of the same hues for text and thin lines.
ORANGE, SKY, GREEN, YELLOW = '#e69f00', '#56b4e9', '#009e73', '#f0e442'
BLUE, VERMILLION, PURPLE = '#0072b2', '#d55e00', '#cc79a7'
DARK_GREEN, DARK_VERMILLION, DARK_PURPLE = '#00664b', '#a63f00', '#9c4f7d'
INK, DARK_GREY, GREY, LIGHT_GREY = '#1a1a1a', '#555555', '#808080', '#e4e4e4'

_STATE_COLOURS: dict[str, str] = {
    State.HSClearReverse: ORANGE,
    State.HSFallingEdgeSearchReverse: VERMILLION,
    State.LSFallingEdgeSearchReverse: VERMILLION,
    State.SecondHSSearch: PURPLE,
    State.TouchProbeSearch: PURPLE,
    State.ZPulseSearch: PURPLE,
    State.ZPulseSearchReverse: PURPLE,
    State.MechanicalEndDetection: YELLOW,
    State.HomeShift: GREEN,
    State.Squaring: YELLOW,
    State.Proving: PURPLE,
    State.Cancel: GREY,
}


def state_colour(state: str) -> str:
    """Return the colour of a home state; those not told apart are the searches toward."""
    return _STATE_COLOURS.get(state, SKY)
