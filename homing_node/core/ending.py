# SPDX-License-Identifier: Apache-2.0
"""How a run ends before it is homed: the error that is reported, and the stop of the axis."""

from ..procedures.states import Error
from .limits import Action
from .profile import Profile


class Ending:
    """The error and the stop of one run.

    Attributes:
        error: why the run has ended; NoError while it goes on.
        message: the error in words.
        stopping: whether the axis stops for the error.
        silent: no setpoint may follow, because the servo is off or the feedback is lost; the run
            ends at once.
        servo_off: the servo is to be switched off once the axis is at rest.
        demanded: the hardest deceleration that an error demands; 0: none does.
    """

    __slots__ = (
        'error',
        'message',
        'stopping',
        'silent',
        'servo_off',
        'demanded',
        '_profile',
        '_deceleration',
    )

    def __init__(self, profile: Profile) -> None:
        self.error = Error.NoError
        self.message = ''
        self.stopping = False
        self.silent = False
        self.servo_off = False
        self.demanded = 0.0
        self._profile = profile
        self._deceleration = 0.0  # of the stop that is under way

    def begin(self, error: Error, message: str) -> None:
        """End the run; the stop follows by :meth:`stop` or :meth:`stop_gently`."""
        self.error, self.message, self.stopping = error, message, True

    def stop(self, action: Action) -> None:
        """Stop as an action says, unless the stop that is under way is as hard."""
        self.servo_off = self.servo_off or action.servo_off
        if action.deceleration is None:
            self.silent = True
            return
        self.demanded = max(self.demanded, action.deceleration)
        if action.deceleration > self._deceleration:
            self._deceleration = action.deceleration
            self._profile.stop(action.deceleration)

    def stop_from(self, position: float, velocity: float, deceleration: float) -> None:
        """Stop from where the axis is, at once, and not from where its command is."""
        self._deceleration = deceleration
        self._profile.stop_from(position, velocity, deceleration)

    def stop_gently(self) -> None:
        """Stop with the deceleration of the present motion."""
        self._deceleration = self._profile.dynamics.deceleration
        self._profile.stop()
