# SPDX-License-Identifier: Apache-2.0
"""What the diagnostics say of the inputs of an axis: level, age, rate and source."""

from collections.abc import Callable, Mapping

from ..core.axis import Axis
from ..core.readings import NEVER
from ..parameters.wiring import Place, Wiring
from .timebase import TimeBase

WORDS = {False: 'off', True: 'on', None: 'unknown'}


class InputStatus:
    """Describes the inputs of an axis, a line each."""

    def __init__(self, wiring: Callable[[], Wiring], clock: TimeBase) -> None:
        self._wiring, self._clock = wiring, clock

    def of(self, axis: Axis) -> Mapping[str, str]:
        """Return, by input: its level, its age, how often it comes, its source; with commas."""
        signals, switches = self._wiring().signals, axis.readings.switches
        lines = {}
        for source, level in axis.levels:
            switch = switches.get(source)
            age = rate = '-'
            if switch is not None and switch.seen > NEVER:
                age = f'{max(0.0, self._clock.now - switch.seen):.3f} s'
                interval = switch.messages.interval
                rate = f'{1.0 / interval:.3g} Hz' if interval else 'on change'
            signal = signals.get(Place(axis.name, source), '-')
            lines[str(source)] = f'{WORDS[level]}, {age}, {rate}, {signal}'
        return lines
