# SPDX-License-Identifier: Apache-2.0
"""The drives of the simulated axes with coordinates of their own, and the controller above them.

A drive takes an offset off the position of its axis; feedback and commands are in its coordinates.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...plant.gantry import Plant
from .controller import ForwardedPositions, PlayedTrajectories

#: A drive takes new coordinates only while its axis is this close to its command, m or rad.
AT_REST = 1e-6


class Cell:
    """The drives and their controller.

    Attributes:
        offsets: What each drive takes off the position of its axis, m or rad.
        active: Whether the controller is active.
    """

    def __init__(
        self,
        axes: Mapping[str, Plant],
        joints: Sequence[str],
        controller: PlayedTrajectories | ForwardedPositions,
        switched: bool,
        now: Callable[[], int],
        forget: Callable[[], None],
        restart_feedback: Callable[[], None],
    ) -> None:
        """Create the cell.

        Args:
            axes: The simulated axes and the sides of gantries, by name.
            joints: Their joints, in the same order.
            controller: What plays the setpoints; it is active.
            switched: Whether it can be switched: it is then off while coordinates change.
            now: Returns the system time at which the present step acts, ns.
            forget: Drops the feedback that is computed and not yet published.
            restart_feedback: Lets another publisher send the feedback, after a silence.
        """
        self.offsets = dict.fromkeys(axes, 0.0)
        self.active = True
        self._deaf = False  # the drives have restarted, and wait for their controller to do so
        self._axes, self._controller, self._switched = axes, controller, switched
        self._now, self._forget, self._restart_feedback = now, forget, restart_feedback
        self._by_joint = dict(zip(joints, axes.items(), strict=True))

    def control(self, now: int) -> None:
        """Let the controller update at a system time in ns, and the drives follow it."""
        for joint, (position, velocity) in self._controller.update(now).items():
            name, axis = self._by_joint[joint]
            if not self._deaf:
                axis.follow(position + self.offsets[name], self._controller.over, velocity)

    def positions(self) -> list[float]:
        """Return where the drives say that their axes are."""
        return [axis.position - self.offsets[name] for name, axis in self._axes.items()]

    def set_position(self, axis: str, position: float) -> str:
        """Change the coordinates of a drive at rest; return why not, '' if it is done."""
        one = self._axes[axis]
        if abs(one.position - one.command) > AT_REST:
            return f'axis {axis} moves'
        if self._switched and self.active:
            return 'the controller is active: it would drive the axis to its old command'
        self.offsets[axis] = one.position - position
        self._forget()  # it is in the coordinates of before
        if self.active:
            self._controller.activate(self.positions())
        return ''

    def restart(self) -> str:
        """Restart the driver: it is silent for a while, and has lost what it took off.

        Its drives stop, and a controller that can be switched must become active anew.
        """
        self.offsets.update(dict.fromkeys(self.offsets, 0.0))
        self._forget()
        self._restart_feedback()
        for axis in self._axes.values():
            axis.follow(axis.command)
        self._deaf = self._switched
        if not self._switched:
            self._controller.activate(self.positions())
        return ''

    def switch(self, on: bool) -> str:
        """Activate or deactivate the controller; return ''."""
        self.active = on
        if on:
            self._deaf = False
            self._controller.activate(self.positions())
        else:
            self._controller.deactivate()
        return ''

    def play(self, message: Any) -> str:
        """Play a message; return why it is refused, else ''."""
        return self._controller.take(message, self._now())

    def repeat(self, joint: str) -> None:
        """Command a joint anew at the next update although its command has not changed."""
        self._controller.repeat(joint)

    def hold(self) -> str:
        """Let the controller hold every axis where it is; return ''."""
        self._controller.activate(self.positions())
        return ''

    def shown(self) -> tuple[list[str], list[float], list[float]]:
        """Return the joints, their commands and their feedback, as the drives have them."""
        controller = self._controller
        commands = controller.commands if isinstance(controller, PlayedTrajectories) else []
        return list(self._by_joint), list(commands), self.positions()

    def left(self) -> float:
        """Return how long the trajectory still lasts, s; below 0: it is over for so long."""
        controller = self._controller
        return controller.left(self._now()) if isinstance(controller, PlayedTrajectories) else 0.0
