# SPDX-License-Identifier: Apache-2.0
"""How the sides of a gantry give way to the springs between them.

Each follower hangs on the leader by a spring of its own. A drive whose servo is on holds its side
where its command says, as three equal poles at `SERVO`: mass, damping, stiffness and integral. A
side therefore leaves its command while the force of a spring changes, and comes back. A side whose
servo is off has no brake: only its guides slow it down. All of it is linear, so that a step is one
product with a matrix and exact, however stiff a spring is.

Everything is in the direction of the leader, in m, kg, s and N (a rotary axis: rad, and so on).
"""

from collections.abc import Sequence
from math import ceil, log2, sqrt
from operator import mul
from typing import NamedTuple

Matrix = list[list[float]]

#: The three poles of a drive that holds its side, rad/s.
SERVO = 200.0
#: How fast guides slow down a side whose servo is off, 1/s.
FRICTION = 10.0
#: The damping of a spring, as a part of the critical one.
DAMPING = 0.05

#: Terms of the exponential series, for a matrix that is scaled to a norm below 1/2.
TERMS = 14


class Spring(NamedTuple):
    """What joins a follower and the leader."""

    stiffness: float  # N/m
    damping: float  # N s/m

    @classmethod
    def between(cls, leader: float, follower: float, stiffness: float) -> 'Spring':
        """Return the spring of a stiffness between two masses, kg."""
        reduced = leader * follower / (leader + follower)
        return cls(stiffness, 2.0 * DAMPING * sqrt(stiffness * reduced))


class Racking:
    """The motion of the sides beside their commands; the leader is the first side."""

    def __init__(
        self, masses: Sequence[float], stiffness: Sequence[float], friction: float = FRICTION
    ) -> None:
        """Create it with the mass of each side, and the stiffness of each follower's spring."""
        self.masses = tuple(masses)
        self.springs = [
            Spring.between(masses[0], mass, k)
            for mass, k in zip(masses[1:], stiffness, strict=True)
        ]
        self.friction = friction
        self._steps: dict[tuple[float, tuple[bool, ...]], Matrix] = {}

    def forces(self, racked: Sequence[float]) -> list[float]:
        """Return what the springs do to each side, N; ``racked`` is the skew of each follower."""
        pulls = [-s.stiffness * by for s, by in zip(self.springs, racked, strict=True)]
        return [-sum(pulls), *pulls]

    def rest(self, racked: Sequence[float]) -> list[float]:
        """Return the state of sides that their drives hold at rest against the springs.

        The state has three numbers for each side: how far it is off (m) and how fast it goes (m/s)
        beside the command of its drive or, with the servo off, beside the place where the servo
        went off; and the integral of the former (m s).
        """
        state: list[float] = []
        for force, mass in zip(self.forces(racked), self.masses, strict=True):
            state += 0.0, 0.0, force / mass / SERVO**3
        return state

    def step(
        self,
        dt: float,
        servos: tuple[bool, ...],
        state: Sequence[float],
        before: Sequence[float],
        after: Sequence[float],
    ) -> list[float]:
        """Return the state after ``dt`` s.

        Args:
            dt: The time of the step, s.
            servos: Which sides have their servo on.
            state: The state at its beginning.
            before: How far the command of each follower is ahead of the leader's, less what is
                square, at its beginning.
            after: The same at its end; it changes evenly.
        """
        key = dt, servos
        matrix = self._steps.get(key)
        if matrix is None:
            matrix = self._steps[key] = self._matrix(dt, servos)
        whole = list(state)
        for a, b in zip(before, after, strict=True):
            whole += a, b - a
        return [sum(map(mul, row, whole)) for row in matrix]

    def _matrix(self, dt: float, servos: Sequence[bool]) -> Matrix:
        """Return what a step makes of the state, and of where the commands are."""
        count = len(servos)
        scale = [1.0, dt, 1.0 / dt] * count
        columns = scale + [1.0, 1.0] * (count - 1)
        rows = exponential(self._rates(dt, servos))[: 3 * count]
        return [
            [value * column / unit for value, column in zip(row, columns, strict=True)]
            for row, unit in zip(rows, scale, strict=True)
        ]

    def _rates(self, dt: float, servos: Sequence[bool]) -> Matrix:
        """Return the matrix of the linear system, in units of ``dt``.

        Speeds are per step, integrals by the step. After the state come, of each follower, how far
        its command is ahead and how fast that changes.
        """
        count = len(servos)
        size = 3 * count + 2 * (count - 1)
        rates = [[0.0] * size for _ in range(size)]
        pole = SERVO * dt
        for side, on in enumerate(servos):
            off, speed, held = 3 * side, 3 * side + 1, 3 * side + 2
            rates[off][speed] = 1.0
            if on:
                rates[speed][off] = -3.0 * pole**2
                rates[speed][speed] = -3.0 * pole
                rates[speed][held] = -(pole**3)
                rates[held][off] = 1.0
            else:
                rates[speed][speed] = -self.friction * dt
        for follower, spring in enumerate(self.springs, 1):
            ahead = 3 * count + 2 * (follower - 1)
            rates[ahead][ahead + 1] = 1.0
            # What pulls the follower back pulls the leader forward.
            for side, sign in ((follower, -1.0), (0, 1.0)):
                row = rates[3 * side + 1]
                k = sign * spring.stiffness * dt**2 / self.masses[side]
                c = sign * spring.damping * dt / self.masses[side]
                row[ahead] += k
                row[3 * follower] += k
                row[0] -= k
                row[ahead + 1] += c
                row[3 * follower + 1] += c
                row[1] -= c
        return rates


def exponential(matrix: Matrix) -> Matrix:
    """Return e to the power of a matrix: its series, scaled down and squared."""
    norm = max(sum(map(abs, row)) for row in matrix)
    halvings = max(0, ceil(log2(2.0 * norm))) if norm else 0
    scaled = [[value / 2.0**halvings for value in row] for row in matrix]
    size = range(len(matrix))
    total = [[float(i == j) for j in size] for i in size]
    term = total
    for n in range(1, TERMS):
        term = [[value / n for value in row] for row in _product(term, scaled)]
        total = [
            [a + b for a, b in zip(x, y, strict=True)] for x, y in zip(total, term, strict=True)
        ]
    for _ in range(halvings):
        total = _product(total, total)
    return total


def _product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum(map(mul, row, column)) for column in columns] for row in a]
