# SPDX-License-Identifier: Apache-2.0
"""A stream of setpoints from a profile to the model of a controller, in simulated time.

Shows what the drive of one axis gets of a plan: how smooth it is, what a lost message, a stall of
the node or its end does. Used by tests and by the benchmark.
"""

import itertools
import random
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from operator import itemgetter
from typing import NamedTuple

from ..core.announcement import Announcer, Course, Row, least_horizon
from ..core.path import Piece, State, state_at
from ..core.phase import Dynamics
from ..core.profile import Profile
from ..plant.controller import (
    RECOMMENDED,
    JtcParameters,
    Message,
    TrajectoryController,
    message_of,
)

NS = 1_000_000_000
JOINT = ('x',)
#: When a stream begins on the clock of the controller, ns, and how long it is held before, s.
EPOCH, BEFORE = NS, 0.02

#: What is ordered when: s from the begin.
Orders = Sequence[tuple[float, Callable[[Profile], None]]]

#: Limits of the courses, and how long a course is played, s.
FAST, SLOW = Dynamics(0.05, 0.5, 0.5), Dynamics(0.005, 0.5, 0.5)
JERK, HARDER, DURATION = 10.0, 2.0, 0.5


class CourseOfRun(NamedTuple):
    """What an axis does in a part of a run, and the largest acceleration that it is allowed."""

    orders: Orders
    acceleration: float


#: Parts of runs that a drive must get as they are planned.
COURSES: Mapping[str, CourseOfRun] = {
    'constant speed, then a stop': CourseOfRun(
        [(0.01, lambda p: p.seek(0.05, FAST)), (0.2, lambda p: p.stop())], 0.5
    ),
    'turning into the slow search': CourseOfRun(
        [
            (0.01, lambda p: p.seek(0.05, FAST)),
            (0.2035, lambda p: p.seek(-0.005, SLOW)),
            (0.37, lambda p: p.move(0.006, FAST)),
        ],
        0.5,
    ),
    'reversal at a limit': CourseOfRun(
        [
            (0.01, lambda p: p.seek(0.05, FAST)),
            (0.1635, lambda p: p.seek(-0.05, FAST)),
            (0.19, lambda p: p.brake_harder(HARDER)),
            (0.3, lambda p: p.stop(HARDER)),
        ],
        HARDER,
    ),
}


@dataclass(frozen=True)
class Stream:
    """How a stream runs: rates in Hz, times in s.

    Arrivals are late by up to ``jitter``; ``phase`` is when within its period the controller
    updates, 0 to 1; of ten messages ``lost`` x 10 are lost; no cycle begins between ``stall`` and
    ``resume`` nor after ``end``. ``one_point``: a point a period ahead without a stamp, as this
    package once sent.
    """

    node: float = 250.0
    controller: float = 1000.0
    jitter: float = 0.0
    phase: float = 0.0
    lost: float = 0.0
    stall: float = inf
    resume: float = inf
    end: float = inf
    lead: float = 0.008
    horizon: float = 0.02
    stamped: bool = True
    one_point: bool = False
    parameters: JtcParameters = RECOMMENDED
    seed: int = 0

    @property
    def announced(self) -> float:
        """How far the plan is told, s."""
        return max(self.horizon, least_horizon(1.0 / self.node, self.lead))


class Commanded(NamedTuple):
    """What the controller commanded for a time, and what was planned for it."""

    time: float
    command: State
    planned: State


@dataclass
class _Sender:
    """The node's side: the messages with their arrival in ns, and what was planned when."""

    how: Stream
    profile: Profile
    announcer: Announcer
    messages: list[tuple[int, Message]] = field(default_factory=list)
    plans: list[tuple[float, float, list[Piece]]] = field(default_factory=list)
    points: int = 0  # of the longest message

    def send(self, due: float, chance: random.Random) -> None:
        how, profile = self.how, self.profile
        period = 1.0 / how.node
        course = Course(*profile.announce(how.announced))
        self.plans.append((due, course.present, course.path))
        if how.one_point:
            row = Row([profile.position], [profile.velocity], [profile.acceleration])
            message = message_of(0, JOINT, [round(period * NS)], [row])
        else:
            times, rows = self.announcer.points([course])
            first = times[0] if how.stamped else 0
            stamp = EPOCH + round(due * NS) + first if how.stamped else 0
            message = message_of(stamp, JOINT, [time - first for time in times], rows)
        self.points = max(self.points, len(message.points))
        arrival = EPOCH + round((due + chance.uniform(0.0, how.jitter)) * NS)
        arrival = max(arrival, self.messages[-1][0] if self.messages else 0)
        if chance.random() >= how.lost:
            self.messages.append((arrival, message))

    def planned(self, time: float) -> State:
        """Return the state that was planned for a time."""
        at = bisect_right(self.plans, time - self.how.lead, key=itemgetter(0))
        due, present, path = self.plans[max(at - 1, 0)]
        return state_at(path, present + time - due)


def run(how: Stream, orders: Orders, jerk: float, duration: float) -> tuple[list[Commanded], int]:
    """Run a stream from rest at 0; return what was commanded, and the points of a message."""
    period, chance, left = 1.0 / how.node, random.Random(how.seed), list(orders)
    profile, announcer = Profile(period, jerk, lead=how.lead), Announcer(period, how.announced)
    sender = _Sender(how, profile, announcer)
    cycle, last = 0, -period
    while (due := cycle * period) < min(duration, how.end):
        cycle += 1
        if how.stall <= due < how.resume:
            continue
        profile.skip(due - last - period)
        while left and left[0][0] <= due:
            left.pop(0)[1](profile)
        profile.update()
        sender.send(due, chance)
        last = due
    return _play(how, sender, duration), sender.points


def _play(how: Stream, sender: _Sender, duration: float) -> list[Commanded]:
    controller = TrajectoryController(JOINT, how.controller, how.parameters)
    controller.activate([0.0])
    step, waiting, found = controller.period, list(reversed(sender.messages)), []
    position = 0.0
    update = EPOCH - round(BEFORE * how.controller) * step + round(how.phase * step)
    while update < EPOCH + duration * NS:
        while waiting and waiting[-1][0] <= update:
            controller.receive(waiting.pop()[1], update)
        command = controller.update(update, [position])
        if command is not None:
            (position,), (velocity,), (acceleration,) = command[1:]
            time = (update + step - EPOCH) / NS
            found.append(Commanded(time, (position, velocity, acceleration), sender.planned(time)))
        update += step
    return found


class Worst(NamedTuple):
    """The largest error of the velocity, and the largest acceleration and jerk, SI."""

    velocity_error: float
    acceleration: float
    jerk: float


def worst(found: Sequence[Commanded], step: float) -> Worst:
    """Judge what was commanded, every ``step`` s, by its positions and its velocities."""
    error = max(abs(one.command[1] - one.planned[1]) for one in found)
    accelerations = differences(differences([one.command[0] for one in found], step), step)
    told = differences([one.command[1] for one in found], step)
    jerks = differences(accelerations, step) + differences(told, step)
    return Worst(error, max(map(abs, accelerations + told)), max(map(abs, jerks)))


def differences(values: Sequence[float], step: float) -> list[float]:
    """Return the rate of change from each value to the next."""
    return [(b - a) / step for a, b in itertools.pairwise(values)]
