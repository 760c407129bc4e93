# SPDX-License-Identifier: Apache-2.0
"""An array of positions, one for each joint of a controller: joints of axes, and other joints.

The array also commands the joints that rest. The command of a joint at rest is fixed when it is
first told, for a command that followed the feedback would let the axis sink. It is forgotten when
a run of the axis ends or its servo is off: then the array holds the axis where it is. A joint that
no axis homes is held where its feedback says it is. Raw positions in m or rad, times in s.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..procedures.states import Error
from .axis import Axis, Setpoint
from .outcome import Outcome


class OtherJoint:
    """A joint of the array that no axis homes; ``timeout``: its feedback may be so old, s."""

    #: As an axis that does nothing.
    powered, moving, handing_over, returning = True, False, False, False

    def __init__(self, name: str, timeout: float) -> None:
        self.name = name
        self.raw_position = 0.0
        self._timeout = timeout
        self._arrival: float | None = None

    def feedback(self, position: float, arrival: float) -> None:
        """Record where the joint is; ``arrival``: when the message arrived."""
        self.raw_position, self._arrival = position, arrival

    @property
    def hold_position(self) -> float:
        """The command that keeps the joint where it is."""
        return self.raw_position

    def unready(self, now: float) -> Outcome | None:
        """Return why it is not known where the joint is, else None."""
        if self._arrival is None:
            text = f'no feedback yet for joint {self.name!r} (position_joints)'
            return Outcome(Error.FeedbackStale, text)
        age = now - self._arrival
        if age <= self._timeout:
            return None
        return Outcome(
            Error.FeedbackStale,
            f'the feedback of joint {self.name!r} (position_joints) is {age:.3f} s old, more than '
            f'{self._timeout:g} s (feedback_timeout)',
        )


class Slot(NamedTuple):
    """One place of the array: its joint, and what it is; ``axis``: '' for another joint."""

    joint: str
    axis: str
    held: Axis | OtherJoint


class PositionArray:
    """The commands of all joints of the array; ``slots``: in the order of the controller."""

    def __init__(
        self, axes: Mapping[str, Axis], axis_of: Mapping[str, str], joints: Sequence[str]
    ) -> None:
        """Create the array.

        Args:
            axes: The axes, by name.
            axis_of: The axis of each joint that is homed.
            joints: The joints in the order of the controller.
        """
        timeout = min(axis.parameters.feedback_timeout for axis in axes.values())
        self.others = {
            joint: OtherJoint(joint, timeout) for joint in joints if joint not in axis_of
        }
        self.slots = [
            Slot(joint, axis_of.get(joint, ''), self.others.get(joint) or axes[axis_of[joint]])
            for joint in joints
        ]
        self._fixed: dict[str, float] = {}  # the commands of joints at rest
        self._returning: set[str] = set()  # in the last cycle: axes whose servo went off in a run

    def commands(self, moving: Mapping[str, Setpoint]) -> list[tuple[float, float]] | None:
        """Return the position and velocity of each joint for a cycle, None: nothing is told.

        Args:
            moving: The setpoints of the axes that move in this cycle, by the axis's name.
        """
        for slot in self.slots:
            held = slot.held
            if slot.axis in moving or not held.powered or held.handing_over:
                self._fixed.pop(slot.joint, None)
        returning = {slot.axis for slot in self.slots if slot.held.returning}
        news, self._returning = returning - self._returning, returning
        if moving or news:
            return [
                moving[slot.axis][:2] if slot.axis in moving else (self._held(slot), 0.0)
                for slot in self.slots
            ]
        if not any(slot.held.moving for slot in self.slots):
            self._fixed.clear()
        return None

    def unready(self, now: float) -> Outcome | None:
        """Return of which joint it is not known where it is, else None."""
        for _, axis, held in self.slots:
            if isinstance(held, OtherJoint):
                unready = held.unready(now)
                if unready is not None:
                    return unready
            elif not held.readings.known:
                return Outcome(Error.FeedbackStale, f'axis {axis}: no feedback yet')
            elif not held.readings.feedback_is_fresh(now):
                old = now - held.readings.arrival
                text = f'axis {axis}: the feedback is {old:.3f} s old, the array has its position'
                return Outcome(Error.FeedbackStale, text)
        return None

    def _held(self, slot: Slot) -> float:
        """Return the command that holds a joint where it is."""
        if not slot.held.powered:
            return slot.held.hold_position
        return self._fixed.setdefault(slot.joint, slot.held.hold_position)
