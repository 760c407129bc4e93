# SPDX-License-Identifier: Apache-2.0
"""Home a gantry without ROS: the core of all sides against a simulated gantry."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from ..core.axis import Axis, Setpoint
from ..core.gantry.axis import GantryAxis
from ..course import Course, Sample
from ..parameters.axis import AxisParameters
from ..plant.gantry import ROUNDING, Gantry, Plant
from ..plant.layout import AxisLayout
from .link import DIRECT, Link, Transport
from .run import Rehearsal

Followers = Mapping[str, AxisParameters]
NO_OWN: Mapping[str, Transport] = MappingProxyType({})


class GantryRehearsal(Rehearsal):
    """A gantry, its plant and the messages between them, in simulated time.

    Attributes:
        gantry: the plant.
        links: what is between each follower and its side, by full names.
    """

    def __init__(
        self,
        name: str,
        parameters: AxisParameters,
        followers: Followers,
        layout: AxisLayout,
        transport: Transport = DIRECT,
        position: float | None = None,
        own: Mapping[str, Transport] = NO_OWN,
    ) -> None:
        """Put the gantry at rest.

        Args:
            name: the name of the axis.
            parameters: the leader's parameters.
            followers: the parameters of the followers, by their full names.
            layout: of the leader, with those of the followers.
            transport: how messages travel.
            position: where the leader stands; the followers are as skewed as in the layout.
            own: how messages of some followers travel.

        Raises:
            ValueError: A side would be beyond a hard stop.
        """
        self._name, self._followers = name, followers
        super().__init__(parameters, layout, transport, position)
        assert isinstance(self.axis, GantryAxis)
        self.links = {
            follower.name: Link(
                follower,
                self.gantry.sides[follower.name],
                own.get(follower.name, transport),
                f'{transport.seed} {follower.name}',
            )
            for follower in self.axis.followers
        }
        self._drives_on = True
        self._begin_course()

    def _made(
        self, parameters: AxisParameters, layout: AxisLayout, position: float | None
    ) -> tuple[Axis, Plant]:
        leader = layout.start if position is None else position
        places = {
            name: _moved(one, leader - layout.start) for name, one in layout.followers.items()
        }
        self.gantry = Gantry(self._name, layout, {self._name: leader, **places})
        axis = GantryAxis(self._name, parameters, self.period, 0.0, self._followers)
        return axis, self.gantry.sides[self._name]

    @property
    def drives(self) -> Mapping[str, Any]:
        """What gets the messages, by full names."""
        followers = {name: link.axis for name, link in self.links.items()}
        return {self._name: self.axis, **followers}

    def cycle(self) -> Setpoint | None:
        """Let the plant run for one period, deliver what is due, update all sides."""
        setpoint = super().cycle()
        state = str(self.axis.state)
        for link in self.links.values():
            own: Setpoint | None = link.axis.setpoint if setpoint is not None else None
            if own is not None:
                link.plant.follow(own[0], over=self.period)
                link.course.samples.append(Sample(self.time, state, *own, link.plant.position))
                link.course.forces.append(getattr(link.plant, 'force', 0.0))
        if self.axis.servo_on is not self._drives_on:
            self._drives_on = self.axis.servo_on
            for side in self.gantry.sides.values():
                side.servo(self._drives_on)
        return setpoint

    def enable(self, name: str, on: bool) -> None:
        """Let the drive of a side switch its servo by itself; the core gets to know of it."""
        self.gantry.sides[name].servo(on)
        self.drives[name].enable(on)

    def step(self, count: int = 1) -> None:
        for _ in range(count):
            super().step()
            for link in self.links.values():
                link.step()

    def deliver(self, now: float) -> None:
        super().deliver(now)
        for link in self.links.values():
            link.deliver(now)

    def _begin_course(self) -> None:
        super()._begin_course()
        for name, link in self.links.items():
            link.course = Course(mirrored=self.gantry.sides[name].sign < 0.0)
        self.course.followers = {name: link.course for name, link in self.links.items()}


def _moved(layout: AxisLayout, by: float) -> float:
    """Return where a follower stands when the gantry is moved as a whole from its start."""
    place = layout.start + (-by if layout.mirrored else by)
    low, high = layout.hard_stops
    inside = min(max(place, low), high)
    return inside if abs(place - inside) < ROUNDING else place


def home_gantry(
    name: str,
    parameters: AxisParameters,
    followers: Followers,
    layout: AxisLayout,
    transport: Transport = DIRECT,
) -> Course:
    """Home a gantry once and return the course; its run does not pause."""
    parameters = replace(parameters, pause_mode=False)
    return GantryRehearsal(name, parameters, followers, layout, transport).home()
