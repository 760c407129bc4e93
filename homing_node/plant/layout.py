# SPDX-License-Identifier: Apache-2.0
"""Where things are on an axis: hard stops, switches, index pulses, the touch plate.

Positions are raw positions in m (linear axis) or rad (rotary axis), times in s.
"""

import sys
from collections.abc import Mapping, Sequence
from math import inf, isfinite, isnan
from typing import NamedTuple, TypeGuard

from ..procedures.states import LIMIT_PAIRS, LIMIT_SWITCHES, Input

#: The inputs that are levels, in the order in which happenings at one position are reported.
SWITCHES: tuple[str, ...] = tuple(i.value for i in (Input.HOME_SWITCH, *LIMIT_SWITCHES))

#: How a drive stops that hears no setpoint where its layout does not say, m/s² or rad/s².
STOP_DEC = 1.0


class SwitchLayout(NamedTuple):
    """Where a switch's flag is.

    The switch turns on when the axis enters [on_from, on_to] and off when it has left it by more
    than `hysteresis`; all three in m or rad. `inverted`: normally closed, the raw (electrical)
    level is false while the switch is on.
    """

    on_from: float
    on_to: float
    hysteresis: float = 0.0
    inverted: bool = False


class AxisLayout(NamedTuple):
    """Where things are on an axis, in raw positions, m or rad.

    `hard_stops` is the lower and the upper end. `switches` has the fitted switches by input name
    (`SWITCHES`). Index pulses are at `index_offset` + k · `index_pitch` for all whole k; a pitch
    of 0 means that there is no index. `touch_probe` is the position of the touch plate. `lag` is
    the first-order time constant between command and feedback in s. `start` is the first position.

    `command_timeout` in s: a drive that hears no setpoint keeps its velocity for that long, then
    stops with `stop_dec` (m or rad per s²) and heeds setpoints no more until its servo is switched
    on. 0: it stands where the last setpoint was.
    """

    hard_stops: tuple[float, float]
    switches: Mapping[str, SwitchLayout]
    index_pitch: float = 0.0
    index_offset: float = 0.0
    touch_probe: float | None = None
    lag: float = 0.0
    start: float = 0.0
    command_timeout: float = 0.0
    stop_dec: float = STOP_DEC


def mirrored(layout: AxisLayout) -> AxisLayout:
    """Return the layout with all positions negated and positive and negative inputs swapped."""
    other = {a.value: b.value for pair in LIMIT_PAIRS.values() for a, b in (pair, pair[::-1])}
    return layout._replace(
        hard_stops=(-layout.hard_stops[1], -layout.hard_stops[0]),
        switches={
            other.get(name, name): switch._replace(on_from=-switch.on_to, on_to=-switch.on_from)
            for name, switch in layout.switches.items()
        },
        index_offset=-layout.index_offset,
        touch_probe=None if layout.touch_probe is None else -layout.touch_probe,
        start=-layout.start,
    )


def layouts_from(mapping: Mapping[str, object]) -> dict[str, AxisLayout]:
    """Read layouts, as parsed from YAML: axis name → the keys below → value.

    `hard_stops` ([lower, upper]) is required. `<switch>` ([from, to]) and `<switch>_hysteresis`
    for every name in `SWITCHES`; `inverted`, a list of such names; `index_pitch`, `index_offset`,
    `touch_probe`, `lag`, `start`, `command_timeout`, `stop_dec` as in `AxisLayout`. Whole numbers
    are accepted for all reals.

    Raise one ValueError that lists every fault, one a line.
    """
    faults: list[str] = []
    layouts = {}
    for axis, entries in mapping.items():
        if isinstance(entries, Mapping):
            layouts[axis] = _Reader(axis, entries, faults).layout()
        else:
            faults.append(f'axis {axis}: a mapping is expected, not {entries!r}')
    if faults:
        raise ValueError('\n'.join(faults))
    return layouts


class _Reader:
    """Reads the entries of one axis and collects their faults."""

    def __init__(self, axis: str, entries: Mapping[str, object], faults: list[str]) -> None:
        self.axis = axis
        self.left = dict(entries)
        self.faults = faults

    def fault(self, text: str) -> None:
        self.faults.append(f'axis {self.axis}: {text}')

    def layout(self) -> AxisLayout:
        if 'hard_stops' not in self.left:
            self.fault('hard_stops is missing: [lower, upper] in m or rad')
        stops = self.pair('hard_stops') or (-inf, inf)
        if stops[0] == stops[1]:
            self.fault(f'hard_stops leave no travel: both are {stops[0]} m or rad')
        inverted = self.names('inverted')
        switches = {}
        for name in SWITCHES:
            fitted = name in self.left
            flag = self.pair(name)
            if not fitted and f'{name}_hysteresis' in self.left:
                self.fault(f'{name}_hysteresis is given, but {name} is not')
            if not fitted and name in inverted:
                self.fault(f'inverted names {name}, which is not given')
            hysteresis = self.real(f'{name}_hysteresis', 0.0, 'm or rad', least=0.0)
            if flag is not None:
                switches[name] = SwitchLayout(*flag, hysteresis, name in inverted)
        probe = self.real('touch_probe', 0.0, 'm or rad') if 'touch_probe' in self.left else None
        layout = AxisLayout(
            hard_stops=stops,
            switches=switches,
            index_pitch=self.real('index_pitch', 0.0, 'm or rad', least=0.0),
            index_offset=self.real('index_offset', 0.0, 'm or rad'),
            touch_probe=probe,
            lag=self.real('lag', 0.0, 's', least=0.0),
            start=self.real('start', 0.0, 'm or rad'),
            command_timeout=self.real('command_timeout', 0.0, 's', least=0.0),
            stop_dec=self.real('stop_dec', STOP_DEC, 'm/s² or rad/s²', least=1e-9),
        )
        if not stops[0] <= layout.start <= stops[1]:
            self.fault(
                f'start {layout.start} m or rad is beyond hard_stops [{stops[0]}, {stops[1]}]'
            )
        for key in self.left:
            self.fault(f'{key} is unknown')
        return layout

    def real(self, key: str, default: float, unit: str, least: float = -inf) -> float:
        value = self.left.pop(key, default)
        if not _is_real(value) or not isfinite(value):
            self.fault(f'{key} {value!r} is not a number (unit: {unit})')
        elif value < least:
            self.fault(f'{key} {value} {unit} is less than {least} {unit}')
        else:
            return float(value)
        return default

    def pair(self, key: str) -> tuple[float, float] | None:
        value = self.left.pop(key, None)
        if value is None:
            return None
        if (
            not isinstance(value, Sequence)
            or isinstance(value, str)
            or len(value) != 2
            or not all(_is_real(end) and not isnan(end) for end in value)
        ):
            self.fault(f'{key} {value!r} is not a pair [from, to] of numbers, m or rad')
            return None
        low, high = value
        if low > high:
            self.fault(f'{key} begins at {low} and ends below that, at {high} m or rad')
            return None
        return float(low), float(high)

    def names(self, key: str) -> Sequence[str]:
        value = self.left.pop(key, ())
        if not isinstance(value, Sequence) or isinstance(value, str):
            self.fault(f'{key} {value!r} is not a list of switch names')
            return ()
        for name in value:
            if name not in SWITCHES:
                self.fault(f'{key} names {name!r}, which is none of {", ".join(SWITCHES)}')
        return value


def _is_real(value: object) -> TypeGuard[float]:
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, float)
