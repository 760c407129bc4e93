# SPDX-License-Identifier: Apache-2.0
"""What the diagnostics say of the inputs of an axis: level, age, rate and source."""

from collections.abc import Callable, Mapping

from ..core.axis import Axis
from ..core.readings import NEVER
from ..parameters.wiring import Place, Wiring
from ..procedures.states import Input
from .timebase import TimeBase

WORDS = {False: 'off', True: 'on', None: 'unknown'}


class InputStatus:
    """Describes the inputs of an axis, a line each."""

    def __init__(self, wiring: Callable[[], Wiring], clock: TimeBase) -> None:
        self._wiring, self._clock = wiring, clock

    def of(self, axis: Axis) -> Mapping[str, str]:
        """Return, by input: its level, its age, how often it comes, its source; with commas."""
        signals = self._wiring().signals
        lines = {}
        for name, level in axis.levels:
            follower, _, source = name.rpartition('.')
            drive = axis.drives[f'{axis.name}.{follower}' if follower else axis.name]
            switch = drive.readings.switches.get(Input(source))
            age = rate = '-'
            if switch is not None and switch.seen > NEVER:
                age = f'{max(0.0, self._clock.now - switch.seen):.3f} s'
                interval = switch.messages.interval
                rate = f'{1.0 / interval:.3g} Hz' if interval else 'on change'
            signal = signals.get(Place(drive.name, Input(source)), '-')
            lines[name] = f'{WORDS[level]}, {age}, {rate}, {signal}'
        return lines
