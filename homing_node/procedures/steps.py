# SPDX-License-Identifier: Apache-2.0
"""The steps of all home types: the keys of the rows in the tables."""

from typing import NamedTuple

from .states import State


class Step(NamedTuple):
    """A row's key: the published home state and, where a state has several rows, which one."""

    state: State
    phase: str = ''

    def __str__(self) -> str:
        return f'{self.state} ({self.phase})' if self.phase else str(self.state)


HS_SEARCH = Step(State.HSSearch)
HS_AND_Z_PULSE_SEARCH = Step(State.HSAndZPulseSearch)
HS_AND_Z_PULSE_SEARCH_ARMED = Step(State.HSAndZPulseSearch, 'armed')
HS_OFF_SEARCH = Step(State.HSOffSearch)
HS_OFF_AND_Z_PULSE_SEARCH = Step(State.HSOffAndZPulseSearch)
HS_OFF_AND_Z_PULSE_SEARCH_ARMED = Step(State.HSOffAndZPulseSearch, 'armed')
LS_SEARCH = Step(State.LSSearch)
Z_PULSE_SEARCH = Step(State.ZPulseSearch)
Z_PULSE_SEARCH_REVERSE = Step(State.ZPulseSearchReverse)
Z_PULSE_SEARCH_REVERSE_ARMED = Step(State.ZPulseSearchReverse, 'armed')
HS_CLEAR_REVERSE = Step(State.HSClearReverse)
HS_CLEAR_REVERSE_FURTHER = Step(State.HSClearReverse, 'further')
HS_CLEAR_REVERSE_AT_START = Step(State.HSClearReverse, 'at start')
HS_CLEAR_REVERSE_AT_START_FURTHER = Step(State.HSClearReverse, 'at start, further')
HS_FALLING_EDGE_SEARCH_REVERSE = Step(State.HSFallingEdgeSearchReverse)
HS_FALLING_EDGE_SEARCH_REVERSE_FURTHER = Step(State.HSFallingEdgeSearchReverse, 'further')
HS_FALLING_EDGE_SEARCH_REVERSE_SLOW = Step(State.HSFallingEdgeSearchReverse, 'slow')
LS_SEARCH_SECOND = Step(State.LSSearch, 'second')
LS_FALLING_EDGE_SEARCH_REVERSE = Step(State.LSFallingEdgeSearchReverse)
LS_FALLING_EDGE_SEARCH_REVERSE_FURTHER = Step(State.LSFallingEdgeSearchReverse, 'further')
LS_FALLING_EDGE_SEARCH_REVERSE_SLOW = Step(State.LSFallingEdgeSearchReverse, 'slow')
SECOND_HS_SEARCH = Step(State.SecondHSSearch)
SECOND_HS_SEARCH_REVERSE = Step(State.SecondHSSearch, 'reverse')
TOUCH_PROBE_SEARCH = Step(State.TouchProbeSearch)
MECHANICAL_END_DETECTION = Step(State.MechanicalEndDetection)
HOME_SHIFT = Step(State.HomeShift)
HOME_SHIFT_MOVE = Step(State.HomeShift, 'move')
HOMED = Step(State.Idle, 'homed')
JOGGING = Step(State.Jogging)
JOGGED = Step(State.Idle, 'jogged')

#: A run ends with one of these.
ENDS = (HOMED, JOGGED)
