# SPDX-License-Identifier: Apache-2.0
"""The home of a gantry: what of one side takes it away, and that sides may then spring apart."""

from typing import Any

from ...parameters.axis import AxisParameters
from ...procedures.states import Error, Input
from ..axis import Axis
from ..limits import Action
from .follower import Follower
from .trip import Trip


class GantryHome(Axis):
    """An axis with followers, as far as its home is concerned."""

    followers: tuple[Follower, ...]
    _group: AxisParameters

    def __init__(self, *args: Any) -> None:
        """Create the axis; the arguments are those of `Axis`."""
        self._apart: tuple[float, ...] = ()  # of a run that failed: the next one adds nothing
        self._trip = Trip()
        super().__init__(*args)

    def lose_servo_of(self, name: str, tripped: bool) -> None:
        """End a run and lose the home, because the drive of a side is off.

        The sides whose drives are still on come to rest; then all are switched off. At rest a
        drive that trips, and is not on again at once, switches all off.

        Args:
            name: whose drive it is.
            tripped: it was on before.
        """
        text = f'the drive of {name} switched its servo off'
        self._lose_rests()
        self._lose_home(Error.ServoOff, f'{text}; a gantry may spring back then')
        if tripped and not self.running:
            self._trip.tell()
        self.stop(Error.ServoOff, text, Action(self._group.ls_dec, True))

    def lose_home_of(self, name: str, error: Error, text: str) -> None:
        """Lose the home, because that of a follower is lost."""
        self._apart = ()
        self._lose_home(error, f'{name}: {text}')

    def enable(self, enabled: bool) -> None:
        """Record the leader's own servo state; one that goes off ends the run."""
        tripped = self.readings.servo_enabled is True and not enabled
        self.readings.servo_enabled = enabled
        if not enabled and Input.SERVO_ENABLED in self.parameters.inputs:
            self.lose_servo_of(self.name, tripped)

    def _lose_servo(self, text: str, action: Action) -> None:
        self._lose_rests()
        self._lose_home(Error.ServoOff, text)
        super()._lose_servo(text, action)

    def forget_coordinates(self) -> None:
        """Forget the home and where things are: raw positions mean something else now."""
        self._apart = ()
        super().forget_coordinates()

    def feedback_source_changed(self) -> None:
        """Take that another publisher sends the feedback: a driver that has restarted."""
        self._apart = ()
        super().feedback_source_changed()

    def _take_jump(self, jump: float, raw: float) -> None:
        self._apart = ()
        super()._take_jump(jump, raw)

    def _lose_rests(self) -> None:
        """Forget where the last run has left each side."""
        self._rest, self._apart = None, ()
        for follower in self.followers:
            follower.lose_rest()

    def _watch_trip(self, now: float) -> None:
        """Switch all sides off if the drive of one stays off at rest."""
        if self._trip.told:
            off = any(drive.readings.servo_is_off for drive in self.drives.values())
            if self._trip.has_lasted(now, off):
                self.servo_on = False
