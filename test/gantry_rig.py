# SPDX-License-Identifier: Apache-2.0
"""A gantry without ROS: the core against two or more plants, with what goes wrong between them.

Physical positions are those of one machine, in the toward direction: the gantry is square where
all sides are at the same place. Each side has an encoder with a zero of its own. With a
stiffness (N/m) springs join the sides. Lengths in m, times in s.
"""

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from core_rig import rig

from homing_node.core.axis import Axis
from homing_node.core.gantry.axis import GantryAxis
from homing_node.core.outcome import Outcome
from homing_node.parameters.axis import AxisParameters
from homing_node.parameters.gantry import follower_parameters
from homing_node.plant.gantry import plants
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.plant.simulated_axis import SimulatedAxis
from homing_node.procedures.states import LATCHES, HomeType, Input

STEP, PERIOD = 0.001, 0.004
#: Steps from one feedback message to the next.
FEEDBACK = 2


@dataclass
class SideRig:
    """What is particular to a side.

    Attributes:
        skew: how far it is ahead of the leader at the start.
        offset: where its switches are, less the leader's; it is told in `switch_offset`.
        wrong_offset: where they are besides, and it is not told.
        zero: its raw position less its physical one.
        delay: how late its messages arrive; their stamps are true.
        stuck: switches that never change, and their level.
        own: its parameters.
        without: switches that it does not have.
        lag: of its drive.
        mirror: it counts the other way round.
        stop: its hard stop ahead.
    """

    skew: float = 0.0
    offset: float = 0.0
    wrong_offset: float = 0.0
    zero: float = 0.0
    delay: float = 0.0
    stuck: Mapping[str, bool] = field(default_factory=dict)
    own: Mapping[str, object] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    lag: float = 0.0
    mirror: bool = False
    stop: float | None = None


@dataclass
class Sample:
    """A cycle of a run: the state, the setpoints, and where the sides are physically."""

    time: float
    state: str
    commands: tuple[tuple[float, float, float], ...]
    physical: tuple[float, ...]


class Gantry:
    """A gantry and its plants in simulated time; with one side it is a single axis.

    Attributes:
        motor_of: which plant the setpoints of each drive go to.
        encoder_of: whose position each drive gets.
        inverted: drives whose feedback counts the wrong way.
        frozen: drives whose feedback stands still.
        deaf: plants that get no setpoints.
        on_message: whether a level is sent: side, input, time, level.
        on_cycle: called after each cycle.
    """

    def __init__(
        self,
        home_type: HomeType | str = 'HSHS',
        sides: Sequence[SideRig] = (SideRig(), SideRig()),
        direction: int = 1,
        start: float = 0.05,
        built: Mapping[str, Any] | None = None,
        parameters: AxisParameters | None = None,
        layout: AxisLayout | None = None,
        stiffness: float = 0.0,
        **changes: object,
    ) -> None:
        base = rig(home_type).built(**(built or {}))
        values = {
            **base.values,
            'max_skew': 0.002 if len(sides) > 1 else 0.0,
            'homing_reverse_distance': 0.002,
            'switch_stamp_error': 0.0,
            'followers': [f'y{n}' for n in range(2, len(sides) + 1)],
            'joint': 'y1',
            **changes,
        }
        self.parameters = parameters or replace(base, values=values).parameters(direction)
        self.sides, self.direction = sides, direction
        layout = layout or base.layout
        layouts = [_layout(layout, side, direction, start) for side in sides]
        self.plants: list[Any] = [SimulatedAxis(one) for one in layouts]
        if stiffness:
            joined = {
                f'y.y{n}': one._replace(
                    stiffness=stiffness,
                    square_at=-side.zero if side.mirror else side.zero,
                    mirrored=side.mirror,
                )
                for n, (one, side) in enumerate(zip(layouts[1:], sides[1:], strict=True), 2)
            }
            self.plants = list(plants({'y': layouts[0]._replace(followers=joined)}).values())
        self.time, self._steps, self._order = 0.0, 0, count()
        self.samples: list[Sample] = []
        self.motor_of, self.encoder_of = list(range(len(sides))), list(range(len(sides)))
        self.inverted: set[int] = set()
        self.frozen: dict[int, float] = {}
        self.deaf: set[int] = set()
        self.on_message: Callable[[int, Input, float, bool], bool] = lambda *_: True
        self.on_cycle: Callable[[], None] = lambda: None
        self._begin = [plant.position for plant in self.plants]
        self.start_node()

    def start_node(self) -> None:
        """Start the node's side anew: it knows nothing of what was."""
        leader = self.parameters
        followers = {}
        for n, side in enumerate(self.sides[1:], 2):
            own = {
                'switch_offset': self.direction * side.offset,
                'switches': [s for s in leader.switches if s not in side.without],
                **side.own,
            }
            followers[f'y.y{n}'] = follower_parameters(leader, f'y{n}', own)
        self.axis: Any = (
            GantryAxis('y', leader, PERIOD, 0.0, followers)
            if followers
            else Axis('y', leader, PERIOD)
        )
        self.drives = list(self.axis.drives.values())
        self._messages: list[tuple[float, int, Callable[[float], None]]] = []
        self._last: dict[tuple[int, str], float] = {}
        for n, drive in enumerate(self.drives):
            for name, level in self.plants[n].levels().items():
                if Input(name) in drive.parameters.inputs:  # twice: drivers that tell changes
                    for time in (self.time - 9.0, self.time):
                        drive.switch(Input(name), time, self._level(n, name, level), self.time)
            if Input.SERVO_ENABLED in drive.parameters.inputs:
                drive.enable(True)
            drive.feedback(self.time, self.plants[n].position)

    # ------------------------------------------------------------------------------------ physics

    def physical(self, n: int) -> float:
        """Return where a side is, in the toward direction of the gantry."""
        raw = self.plants[n].position - self.sides[n].zero
        return self.direction * raw * (-1 if self.sides[n].mirror else 1)

    @property
    def skews(self) -> list[float]:
        """How far each follower is ahead of the leader, physically."""
        return [self.physical(n) - self.physical(0) for n in range(1, len(self.sides))]

    @property
    def worst(self) -> float:
        """The largest physical skew of the run."""
        return max(
            (abs(place - one.physical[0]) for one in self.samples for place in one.physical[1:]),
            default=0.0,
        )

    def _level(self, n: int, name: str, level: bool) -> bool:
        return self.sides[n].stuck.get(name, level)

    # ------------------------------------------------------------------------------------ the run

    def cycle(self) -> None:
        """Let the plants run for a period, deliver what is due, update the axis."""
        for _ in range(round(PERIOD / STEP)):
            self._steps += 1
            self.time = self._steps * STEP
            for n, plant in enumerate(self.plants):
                for one in plant.step(STEP):
                    self._happen(n, one.time, Input(one.input), one.value)
            if self._steps % FEEDBACK == 0:
                for n, drive in enumerate(self.drives):
                    self._send_feedback(n, drive)
        while self._messages and self._messages[0][0] <= self.time:
            arrival, _, deliver = heapq.heappop(self._messages)
            deliver(arrival)
        setpoint = self.axis.update(self.time)
        followers = getattr(self.axis, 'followers', ())
        commands = [setpoint, *(follower.setpoint for follower in followers)]
        for n, one in enumerate(commands):
            if one is not None and self.motor_of[n] not in self.deaf:
                self.plants[self.motor_of[n]].follow(one[0], over=PERIOD)
        if setpoint is not None:
            assert None not in commands
            self.samples.append(
                Sample(
                    self.time,
                    str(self.axis.state),
                    tuple(one for one in commands if one is not None),
                    tuple(self.physical(n) for n in range(len(self.sides))),
                )
            )
        self.on_cycle()

    def freeze(self, n: int) -> None:
        """Let the encoder of a side stand still."""
        self.frozen[n] = self.plants[n].position

    def _send_feedback(self, n: int, drive: Any) -> None:
        place = self.encoder_of[n]
        position, time = self.plants[place].position, self.time
        if n in self.inverted:
            position = 2.0 * self._begin[place] - position
        position = self.frozen.get(n, position)
        delay = self.sides[n].delay
        if not delay:
            drive.feedback(time, position)
        else:
            self._send(
                (n, 'feedback'),
                time + delay,
                lambda arrival: drive.feedback(time, position, arrival),
            )

    def _happen(self, n: int, time: float, source: Input, value: float | bool) -> None:
        drive, delay = self.drives[n], self.sides[n].delay
        if source in LATCHES:
            self._send((n, source), time + delay, lambda _: drive.latch(source, float(value)))
        elif source in drive.parameters.inputs:
            level = self._level(n, source, bool(value))
            if self.on_message(n, source, time, level):
                self.switch(n, source, time, level)

    def switch(self, n: int, source: Input, time: float, level: bool) -> None:
        """Send a level of a switch."""
        drive = self.drives[n]
        self._send(
            (n, source),
            time + self.sides[n].delay,
            lambda arrival: drive.switch(source, time, level, arrival),
        )

    def _send(self, topic: tuple[int, str], due: float, deliver: Callable[[float], None]) -> None:
        due = max(due, self._last.get(topic, 0.0))
        self._last[topic] = due
        heapq.heappush(self._messages, (due, next(self._order), deliver))

    def home(self, limit: float = 60.0) -> Outcome:
        """Home the gantry; return how that ended."""
        for _ in range(60):
            self.cycle()
        self.samples.clear()
        refused = self.axis.home(self.time)
        return refused or self.finish(limit)

    def until(self, state: str, cycles: int = 1) -> None:
        """Home until the gantry has been in a state for some cycles."""
        for _ in range(60):
            self.cycle()
        self.samples.clear()
        refused = self.axis.home(self.time)
        assert refused is None, refused
        while cycles:
            self.cycle()
            assert self.axis.running, self.axis.outcome
            cycles -= self.axis.state == state

    def finish(self, limit: float = 60.0) -> Outcome:
        """Run until the run has ended, and all sides have come to rest."""
        end = self.time + limit
        while self.axis.running:
            self.cycle()
            assert self.time < end, self.axis.state
        outcome = self.axis.outcome
        for _ in range(30):
            self.cycle()
        return outcome

    @property
    def states(self) -> list[str]:
        """The states of the run, in order."""
        found = [sample.state for sample in self.samples]
        return [s for n, s in enumerate(found) if n == 0 or found[n - 1] != s]


def _layout(layout: AxisLayout, side: SideRig, direction: int, start: float) -> AxisLayout:
    """Return the layout of a side in its raw coordinates."""
    low, high = layout.hard_stops
    by = side.offset + side.wrong_offset
    fitted = {name: f for name, f in layout.switches.items() if name not in side.without}
    placed = layout._replace(
        hard_stops=(low, high if side.stop is None else side.stop),
        switches=_moved(fitted, by),
        start=start + side.skew,
        index_offset=layout.index_offset + side.offset,
        touch_probe=None if layout.touch_probe is None else layout.touch_probe + by,
        lag=side.lag,
    )
    if (direction < 0) != side.mirror:
        placed = mirrored(placed)
    low, high = placed.hard_stops
    probe = placed.touch_probe
    return placed._replace(
        hard_stops=(low + side.zero, high + side.zero),
        switches=_moved(placed.switches, side.zero),
        start=placed.start + side.zero,
        index_offset=placed.index_offset + side.zero,
        touch_probe=None if probe is None else probe + side.zero,
    )


def _moved(flags: Mapping[str, SwitchLayout], by: float) -> dict[str, SwitchLayout]:
    return {
        name: flag._replace(on_from=flag.on_from + by, on_to=flag.on_to + by)
        for name, flag in flags.items()
    }


def bouncing(gantry: Gantry, side: int, source: Input, times: Iterable[float]) -> None:
    """Let a switch of a side bounce after each edge."""

    def bounce(n: int, name: Input, time: float, level: bool) -> bool:
        if (n, name) != (side, source):
            return True
        gantry.switch(n, name, time, level)
        for after in times:
            gantry.switch(n, name, time + after, not level)
            gantry.switch(n, name, time + after + 0.0002, level)
        return False

    gantry.on_message = bounce
