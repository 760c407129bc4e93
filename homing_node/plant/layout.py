# SPDX-License-Identifier: Apache-2.0
"""Where things are on an axis: hard stops, switches, index pulses, the touch plate.

Positions are raw positions in m (linear axis) or rad (rotary axis), times in s.
"""

from collections.abc import Mapping
from math import inf
from types import MappingProxyType
from typing import Any, NamedTuple

from ..parameters.definition import Definition, Interval, table
from ..procedures.states import LIMIT_PAIRS, LIMIT_SWITCHES, Input

#: The inputs that are levels, in the order in which happenings at one position are reported.
SWITCHES: tuple[str, ...] = tuple(i.value for i in (Input.HOME_SWITCH, *LIMIT_SWITCHES))

#: Deceleration of a drive that hears no setpoint, in m/s² or rad/s², where its layout has none.
STOP_DEC = 1.0

#: What one side of a gantry moves, kg, where its layout does not say.
MASS = 50.0

#: Positions and distances on an axis, m or rad.
FURTHEST = 1e6


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


#: A switch that is on nowhere.
NOWHERE = SwitchLayout(inf, inf)


class AxisLayout(NamedTuple):
    """Where things are on an axis, in raw positions, m or rad.

    `hard_stops` is the lower and the upper end. `switches` has the fitted switches by input name
    (`SWITCHES`). `stays_off` has the limit switches of which nobody knows where they are, only
    that they were off wherever a survey was: `NOWHERE`. Index pulses are at `index_offset` + k ·
    `index_pitch` for all whole k; a pitch of 0 means that there is no index. `touch_probe` is the
    position of the touch plate. `lag` is the first-order time constant between command and
    feedback in s. `start` is the first position.

    `command_timeout` in s: a drive that hears no setpoint keeps its velocity for that long, then
    stops with `stop_dec` (m or rad per s²) and heeds setpoints no more until its servo is switched
    on. 0: it stands where the last setpoint was.

    `switch_rate` in Hz: how often the driver reads and publishes the switches; 0: it publishes
    them on change, None: not known.

    `followers` has the other sides of a gantry, by their full names (``y.y2``), each with the
    positions of its own encoder. A spring of `stiffness` (N/m) joins a follower and the leader; it
    has no force where the follower's raw position is the leader's plus `square_at`. A `mirrored`
    follower counts the other way round: there its position is minus that. `mass` in kg is what
    one side moves; its command acts `delay` s later than those of other axes.
    """

    hard_stops: tuple[float, float]
    switches: Mapping[str, SwitchLayout]
    stays_off: Mapping[str, SwitchLayout] = MappingProxyType({})
    index_pitch: float = 0.0
    index_offset: float = 0.0
    touch_probe: float | None = None
    lag: float = 0.0
    start: float = 0.0
    command_timeout: float = 0.0
    stop_dec: float = STOP_DEC
    switch_rate: float | None = None
    followers: 'Mapping[str, AxisLayout]' = MappingProxyType({})
    mass: float = MASS
    delay: float = 0.0
    stiffness: float = 0.0
    square_at: float = 0.0
    mirrored: bool = False

    @property
    def switch_period(self) -> float:
        """How long the driver of the switches takes at most to see an edge, s."""
        return 1.0 / self.switch_rate if self.switch_rate else 0.0


def sides_of(layouts: Mapping[str, AxisLayout]) -> dict[str, AxisLayout]:
    """Return the layout of each axis, and after it those of its followers, by full names."""
    return {
        name: side
        for axis, layout in layouts.items()
        for name, side in ({axis: layout} | dict(layout.followers)).items()
    }


def with_switch_rate(layout: AxisLayout, rate: float | None) -> AxisLayout:
    """Return the layout with a rate for the switches of each side that has none of its own."""
    return layout._replace(
        switch_rate=rate if layout.switch_rate is None else layout.switch_rate,
        followers={name: with_switch_rate(one, rate) for name, one in layout.followers.items()},
    )


def mirrored(layout: AxisLayout) -> AxisLayout:
    """Return the layout with all positions negated and positive and negative inputs swapped."""
    other = {a.value: b.value for pair in LIMIT_PAIRS.values() for a, b in (pair, pair[::-1])}
    return layout._replace(
        hard_stops=(-layout.hard_stops[1], -layout.hard_stops[0]),
        switches={
            other.get(name, name): switch._replace(on_from=-switch.on_to, on_to=-switch.on_from)
            for name, switch in layout.switches.items()
        },
        stays_off={other[name]: switch for name, switch in layout.stays_off.items()},
        index_offset=-layout.index_offset,
        touch_probe=None if layout.touch_probe is None else -layout.touch_probe,
        start=-layout.start,
        square_at=-layout.square_at,
        followers={name: mirrored(each) for name, each in layout.followers.items()},
    )


def shifted(layout: AxisLayout, by: float) -> AxisLayout:
    """Return the layout of an axis whose encoder shows all positions higher by a distance."""
    low, high = layout.hard_stops
    return layout._replace(
        hard_stops=(low + by, high + by),
        switches={
            name: switch._replace(on_from=switch.on_from + by, on_to=switch.on_to + by)
            for name, switch in layout.switches.items()
        },
        index_offset=layout.index_offset + by,
        touch_probe=None if layout.touch_probe is None else layout.touch_probe + by,
        start=layout.start + by,
    )


def length(name: str, text: str, default: Any, minimum: float = -FURTHEST) -> Definition:
    """Return the definition of a position or a distance."""
    return Definition(text, float, 'm or rad', minimum, FURTHEST, name=name, default=default)


def _time(name: str, text: str, maximum: float) -> Definition:
    return Definition(text, float, 's', 0.0, maximum, name=name, default=0.0)


#: How often the driver of an axis reads and publishes its switches.
SWITCH_RATE = Definition(
    'rate at which the driver reads and publishes the switches (0: on change only)',
    float,
    'Hz',
    0.1,
    5000.0,
    or_zero=True,
    name='switch_rate',
    default=None,
)

#: The keys of an axis in a layout.
LAYOUT: Mapping[str, Definition] = table(
    Definition('the lower and the upper end', Interval, 'm or rad', name='hard_stops'),
    *(
        Definition(f'where {name} is on', Interval, 'm or rad', name=name, default=None)
        for name in SWITCHES
    ),
    *(
        length(f'{name}_hysteresis', f'how far behind its edge {name} turns off', 0.0, 0.0)
        for name in SWITCHES
    ),
    Definition(
        'the switches that are normally closed',
        tuple,
        name='inverted',
        default=(),
        names=SWITCHES,
    ),
    Definition(
        'limit switches that were off wherever a survey was: where they are is not known',
        tuple,
        name='stays_off',
        default=(),
        names=tuple(map(str, LIMIT_SWITCHES)),
    ),
    length('index_pitch', 'distance between index pulses (0: no index)', 0.0, 0.0),
    length('index_offset', 'position of one index pulse', 0.0),
    length('touch_probe', 'position of the touch plate', None),
    length('start', 'the first position', 0.0),
    _time('lag', 'time constant between command and feedback', 60.0),
    _time('command_timeout', 'a drive without setpoints stops after this (0: never)', 3600.0),
    Definition(
        'deceleration of a drive without setpoints',
        float,
        'm/s² or rad/s²',
        1e-4,
        1e6,
        name='stop_dec',
        default=STOP_DEC,
    ),
    SWITCH_RATE,
    Definition(
        'the other sides of a gantry, whose keys stand below <axis>.<follower>',
        list,
        name='followers',
        default=[],
    ),
    Definition(
        'what this side of a gantry moves', float, 'kg', 1e-3, 1e6, name='mass', default=MASS
    ),
    _time('delay', 'how much later this side of a gantry obeys than other axes', 10.0),
)

#: How often a simulated machine reports its positions, and how late a setpoint takes effect.
FEEDBACK_RATE = Definition(
    'rate of joint_states', float, 'Hz', 1.0, 5000.0, name='feedback_rate', default=500.0
)
DEAD_TIME = Definition(
    "time from a setpoint's arrival to its first effect",
    float,
    's',
    0.0,
    1.0,
    name='dead_time',
    default=0.004,
)
