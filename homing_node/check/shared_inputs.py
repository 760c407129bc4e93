# SPDX-License-Identifier: Apache-2.0
"""Checks inputs that are one signal: home switch and limit, both limits, several axes."""

from collections.abc import Iterator

from ..core.limits import limits_of
from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..parameters.wiring import Place, Wiring, wiring_of
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.states import LIMIT_SWITCHES, HomeType, Input, LimitPair, Role
from .finding import Finding, Severity

#: What each pair of limit switches is called in the name of a home type.
NAMES = {LimitPair.HARDWARE: 'LS', LimitPair.NEAR: 'NearLS', LimitPair.EXTERNAL: 'ExternalLS'}


class SharedInputs:
    """The findings about signals that more than one input reads."""

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.wiring: Wiring = wiring_of(configuration)

    def check(self) -> Iterator[Finding]:
        """Yield the findings of all axes."""
        for axis, parameters in self.configuration.axes.items():
            yield from self._home_and_limit(axis, parameters)
            yield from self._both_limits(axis, parameters)
            yield from self._several_axes(axis, parameters)

    def _signal(self, axis: str, name: Input) -> str:
        return self.wiring.signals[Place(axis, name)]

    def _home_and_limit(self, axis: str, p: AxisParameters) -> Iterator[Finding]:
        """Find a home switch that is also a limit switch which turns or stops the axis."""
        if Input.HOME_SWITCH not in p.procedure.inputs:
            return
        limits = limits_of(p)
        for other in self.wiring.others(Place(axis, Input.HOME_SWITCH)):
            limit = limits.get(other.input) if other.axis == axis else None
            if limit is None or (limit.role is not Role.REVERSAL and not limit.action):
                continue
            fits = fitting_type(p, limit.pair)
            remedy = f'home_type: {fits}, or switches without {limit.input}'
            if limit.way is Way.AWAY:
                other_way = 'Negative' if p.home_direction.sign > 0 else 'Positive'
                remedy = f'home_type: {fits} with home_direction: {other_way}'
            yield Finding(
                Severity.error,
                axis,
                'home-is-limit',
                f'home_switch and {limit.input} are one input '
                f'({self._signal(axis, Input.HOME_SWITCH)})',
                f'{p.home_type} cannot home: its home switch is the {limit.name}',
                '',
                self._signal(axis, Input.HOME_SWITCH),
                remedy,
            )

    def _both_limits(self, axis: str, p: AxisParameters) -> Iterator[Finding]:
        """Find pairs of limit switches in series: a rise does not say at which end."""
        for pair in sorted(self.wiring.in_series(axis)):
            positive = p.limit_switch(pair, Way.TOWARD)
            signal = self._signal(axis, positive)
            what = f'both {pair} limit switches are one input ({signal})'
            if p.procedure.target is pair:
                yield Finding(
                    Severity.error,
                    axis,
                    'limits-in-series',
                    what,
                    f'{p.home_type} homes on one of them, and the input does not say on which',
                    '',
                    signal,
                    'an input for each, or a home_type that homes on something else',
                )
            else:
                yield Finding(
                    Severity.info,
                    axis,
                    'limits-in-series',
                    what,
                    'a rise counts for the limit that the axis moves into, and no run starts '
                    'while the input is on',
                )

    def _several_axes(self, axis: str, p: AxisParameters) -> Iterator[Finding]:
        """Find switches that more than one axis reads."""
        inputs = [name for name in p.inputs if name == Input.HOME_SWITCH or name in LIMIT_SWITCHES]
        for name, others in self.wiring.sharing(axis, inputs).items():
            names = ', '.join(dict.fromkeys(other.axis for other in others))
            what = f'{name} is also an input of {names} ({self._signal(axis, name)})'
            together = [
                group
                for group in self.configuration.home_sequence
                if axis in group and any(other.axis in group for other in others)
            ]
            for group in together:
                yield Finding(
                    Severity.error,
                    axis,
                    'shared-together',
                    f'{what}, and home_sequence homes {", ".join(group)} together',
                    'an axis would home on the switch of another one',
                    'home_sequence',
                    ', '.join(group),
                    'each of these axes in a group of its own',
                )
            if name == Input.HOME_SWITCH and not leaves_switch(p):
                yield Finding(
                    Severity.warning,
                    axis,
                    'shared-not-left',
                    what,
                    'the axis may rest on the switch when it is homed, and then the others are '
                    'refused',
                    'home_shift_distance',
                    p.home_shift_distance,
                    'a distance that leaves the switch: '
                    + ('> 0 m' if homes_on_fall(p) else '< 0 m'),
                )


def fitting_type(p: AxisParameters, pair: LimitPair) -> HomeType:
    """Return the home type that uses a limit switch the way this one uses the home switch."""
    z_pulse = Event.Z_PULSE in p.procedure.events
    return HomeType(f'{NAMES[pair]}ReverseZPulse' if z_pulse else NAMES[pair])


def homes_on_fall(p: AxisParameters) -> bool:
    """Whether the home position lies behind the flag, seen along the homing direction."""
    return Event.HS_RISES not in p.procedure.events


def leaves_switch(p: AxisParameters) -> bool:
    """Whether the final move leads away from the home switch."""
    shift = p.home_shift_distance
    return shift > 0.0 if homes_on_fall(p) else shift < 0.0
