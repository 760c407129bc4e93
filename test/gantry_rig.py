# SPDX-License-Identifier: Apache-2.0
"""A gantry without ROS: the core against two or more plants, with what goes wrong between them.

Physical positions are those of one machine: the gantry is square where all sides are at the same
place. Each side has an encoder with a zero of its own. Lengths in m, times in s.
"""

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from core_rig import QUICK, Rig, rig

from homing_node.core.gantry_axis import GantryAxis
from homing_node.core.outcome import Outcome
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.gantry import follower_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.plant.simulated_axis import SimulatedAxis
from homing_node.procedures.states import LATCHES, Error, HomeType, Input

STEP = 0.001
PERIOD = 0.004
FEEDBACK = 2  # steps


@dataclass
class SideRig:
    """What is particular to a side.

    Attributes:
        skew: how far it is ahead of the leader at the start.
        offset: where its switches are, less the leader's.
        zero: its raw position less its physical one.
        delay: how late its messages arrive; their stamps are true.
        dead: switches that never change.
        stuck: switches that are always on.
        own: its parameters.
        without: switches that it does not have.
        pitch_off: how far its index is moved.
        lag: of its drive.
    """

    skew: float = 0.0
    offset: float = 0.0
    zero: float = 0.0
    delay: float = 0.0
    dead: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    own: Mapping[str, object] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    pitch_off: float = 0.0
    lag: float = 0.0
    mirror: bool = False


Leader = SideRig
Sample = tuple[float, str, tuple[float, ...], tuple[float, ...]]


class Gantry:
    """A gantry and its plants in simulated time."""

    def __init__(
        self,
        home_type: HomeType | str = 'HSHS',
        sides: Sequence[SideRig] = (SideRig(), SideRig()),
        direction: int = 1,
        start: float = 0.05,
        index_offset: float | None = None,
        **changes: object,
    ) -> None:
        one = rig(home_type)
        values: dict[str, object] = {
            **one.values,
            'max_skew': 0.002,
            'homing_reverse_distance': 0.002,
            'followers': [f'y{n}' for n in range(2, len(sides) + 1)],
            'joint': 'y1',
            'switch_stamp_error': 0.0,
            **changes,
        }
        base: Rig = replace(one, values=values)
        if index_offset is not None:
            base = base.built(index_offset=index_offset)
        leader = base.parameters(direction)
        followers = {
            f'y.y{n}': follower_parameters(
                leader,
                f'y{n}',
                {
                    'switch_offset': direction * side.offset,
                    'switches': [s for s in leader.switches if s not in side.without],
                    **side.own,
                },
            )
            for n, side in enumerate(sides[1:], 2)
        }
        self.sides, self.direction = sides, direction
        self.axis = GantryAxis('y', leader, PERIOD, 0.0, followers)
        self.drives = list(self.axis.drives.values())
        self.plants = []
        for side, drive in zip(sides, self.drives, strict=True):
            layout = _layout(base.layout, side, direction, start)
            self.plants.append(SimulatedAxis(layout))
            del drive
        self.time, self._steps = 0.0, 0
        self._messages: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = count()
        self._last: dict[tuple[int, str], float] = {}
        self.samples: list[Sample] = []
        self.frozen: set[int] = set()
        #: Which plant each drive's setpoints go to, and whose feedback it gets.
        self.motor_of = list(range(len(sides)))
        self.encoder_of = list(range(len(sides)))
        self.on_message: Callable[[int, Input, float, bool], bool] = lambda *_: True
        self.on_cycle: Callable[[], None] = lambda: None
        for n, (side, drive, plant) in enumerate(
            zip(sides, self.drives, self.plants, strict=True)
        ):
            for name, level in plant.levels().items():
                if Input(name) in drive.parameters.inputs:
                    drive.switch(Input(name), -9.0, self._level(n, name, level), 0.0)
                    drive.switch(Input(name), 0.0, self._level(n, name, level), 0.0)
            drive.feedback(0.0, plant.position)
            del side

    # ------------------------------------------------------------------------------------ physics

    def physical(self, n: int) -> float:
        """Return where a side is, in the toward direction of the gantry."""
        side = self.sides[n]
        raw = self.plants[n].position - side.zero
        return self.direction * raw * (-1 if side.mirror else 1)

    def skews(self) -> list[float]:
        """Return how far each follower is ahead of the leader, physically."""
        return [self.physical(n) - self.physical(0) for n in range(1, len(self.sides))]

    @property
    def worst(self) -> float:
        """The largest physical skew of the run."""
        return max((abs(s - at[0]) for *_, at in self.samples for s in at[1:]), default=0.0)

    def _level(self, n: int, name: str, level: bool) -> bool:
        side = self.sides[n]
        if name in side.dead:
            return False
        return True if name in side.stuck else level

    # ------------------------------------------------------------------------------------ the run

    def cycle(self) -> None:
        for _ in range(round(PERIOD / STEP)):
            self._steps += 1
            self.time = self._steps * STEP
            for n, plant in enumerate(self.plants):
                for happening in plant.step(STEP):
                    self._happen(n, happening.time, Input(happening.input), happening.value)
            if self._steps % FEEDBACK == 0:
                for n, drive in enumerate(self.drives):
                    if n not in self.frozen:
                        position = self.plants[self.encoder_of[n]].position
                        self._send_feedback(n, drive, self.time, position)
                    else:
                        self._send_feedback(n, drive, self.time, self._frozen_at[n])
        while self._messages and self._messages[0][0] <= self.time:
            arrival, _, deliver = heapq.heappop(self._messages)
            deliver(arrival)
        setpoint = self.axis.update(self.time)
        setpoints = [setpoint, *(follower.setpoint for follower in self.axis.followers)]
        for n, one in enumerate(setpoints):
            if one is not None:
                self.plants[self.motor_of[n]].follow(one[0], over=PERIOD)
        if setpoint is not None:
            self.samples.append(
                (
                    self.time,
                    str(self.axis.state),
                    tuple(one[0] for one in setpoints if one is not None),
                    tuple(self.physical(n) for n in range(len(self.sides))),
                )
            )
        self.on_cycle()

    def freeze(self, n: int) -> None:
        """Let the encoder of a side stand still."""
        self._frozen_at = {n: self.plants[n].position}
        self.frozen.add(n)

    def _send_feedback(self, n: int, drive: object, time: float, position: float) -> None:
        delay = self.sides[n].delay
        if not delay:
            drive.feedback(time, position)  # type: ignore[attr-defined]
        else:
            self._send(
                (n, 'feedback'),
                time + delay,
                lambda arrival: drive.feedback(time, position, arrival),  # type: ignore
            )

    def _happen(self, n: int, time: float, source: Input, value: float | bool) -> None:
        drive, side = self.drives[n], self.sides[n]
        if source in LATCHES:
            self._send((n, source), time + side.delay, lambda _: drive.latch(source, float(value)))
            return
        if source not in drive.parameters.inputs or not self.on_message(n, source, time, value):
            return
        level = self._level(n, source, bool(value))
        self.switch(n, source, time, level)

    def switch(self, n: int, source: Input, time: float, level: bool) -> None:
        """Send a level of a switch."""
        drive, delay = self.drives[n], self.sides[n].delay
        self._send(
            (n, source), time + delay, lambda arrival: drive.switch(source, time, level, arrival)
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
        if refused is not None:
            return refused
        return self.finish(limit)

    def finish(self, limit: float = 60.0) -> Outcome:
        end = self.time + limit
        while self.axis.running:
            self.cycle()
            assert self.time < end, self.axis.state
        return self.axis.outcome

    @property
    def states(self) -> list[str]:
        """The states of the run, in order."""
        found = [sample[1] for sample in self.samples]
        return [s for n, s in enumerate(found) if n == 0 or found[n - 1] != s]


def _layout(layout: AxisLayout, side: SideRig, direction: int, start: float) -> AxisLayout:
    """Return the layout of a side in its raw coordinates."""

    def moved(flag: SwitchLayout) -> SwitchLayout:
        return replace_flag(flag, side.offset)

    switches = {
        name: moved(flag) for name, flag in layout.switches.items() if name not in side.without
    }
    placed = layout._replace(
        switches=switches,
        start=start + side.skew,
        index_offset=layout.index_offset + side.offset + side.pitch_off,
        touch_probe=None if layout.touch_probe is None else layout.touch_probe + side.offset,
        lag=side.lag,
    )
    if (direction < 0) != side.mirror:
        placed = mirrored(placed)
    zero = side.zero
    return placed._replace(
        hard_stops=(placed.hard_stops[0] + zero, placed.hard_stops[1] + zero),
        switches={name: replace_flag(flag, zero) for name, flag in placed.switches.items()},
        start=placed.start + zero,
        index_offset=placed.index_offset + zero,
        touch_probe=None if placed.touch_probe is None else placed.touch_probe + zero,
    )


def replace_flag(flag: SwitchLayout, by: float) -> SwitchLayout:
    return flag._replace(on_from=flag.on_from + by, on_to=flag.on_to + by)


__all__ = ['QUICK', 'Error', 'Gantry', 'SideRig', 'axis_parameters']
