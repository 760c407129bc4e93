# SPDX-License-Identifier: Apache-2.0
"""Axes that read the same signal: they home one after another, and only while it is off."""

from collections.abc import Mapping

from ..parameters.wiring import Place, Wiring
from ..procedures.states import LATCHES, Error, Input
from .axis import Axis
from .outcome import Outcome


class SharedSignals:
    """Refuses to home an axis while another axis uses one of its switches.

    Attributes:
        wiring: Which input reads which signal; replaced when the wiring changes.
    """

    def __init__(self, axes: Mapping[str, Axis], wiring: Wiring) -> None:
        self._axes = axes
        self.wiring = wiring

    def refusal(self, name: str) -> Outcome | None:
        """Return why an axis cannot home beside the axes that share its inputs, or None."""
        axis = self._axes[name]
        for source, others in self.wiring.sharing(name, axis.parameters.inputs).items():
            signal = self.wiring.signals[Place(name, source)]
            names = list(dict.fromkeys(other.axis for other in others))
            for other in names:
                if self._axes[other].moving:
                    return Outcome(
                        Error.Busy,
                        f'axis {name}: axis {other} is homing, and both read {source} ({signal})',
                    )
            if (
                source not in LATCHES
                and source is not Input.SERVO_ENABLED
                and axis.readings.is_on(source)
            ):
                listed = ', '.join(names)
                return Outcome(
                    Error.SwitchUnknown,
                    f'axis {name}: {source} ({signal}) is on, and axis {listed} reads it too, so '
                    f'that the switch of {name} cannot be seen; does {listed} stand on its '
                    'switch? move it off (home_shift_distance leaves a switch after homing)',
                )
        return None
