# SPDX-License-Identifier: Apache-2.0
"""What a drive gets of the setpoints, behind a model of joint_trajectory_controller.

The counterpart is what this package once sent: one point a message, a period ahead, without a
stamp, to a controller that accepts a point in motion. Each figure is the worst of all rates of the
node and of three courses: constant speed and a stop, a turn into the slow search, a reversal at a
limit.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from figures import Figure

from homing_node.plant.controller import RECOMMENDED
from homing_node.rehearsal.stream import COURSES, DURATION, FAST, JERK, Stream, run, worst

NODES = (250.0, 500.0, 1000.0)
CONTROLLERS = (100.0, 250.0, 500.0, 1000.0)
JITTERS = (0.0, 0.0003, 0.0015)
#: When within its period the controller updates.
PHASE = 0.37
#: What makes a stream the counterpart.
ONE_POINT: Mapping[str, Any] = {
    'one_point': True,
    'lead': 0.0,
    'parameters': RECOMMENDED._replace(allow_nonzero_velocity_at_trajectory_end=True),
}
#: What is allowed, as a part of the planned velocity and of the limits.
VELOCITY, LIMIT = 0.01, 1.05


class Quality(NamedTuple):
    """Error of the velocity, acceleration, jerk, as a part of the velocity and of the limits."""

    velocity: float
    acceleration: float
    jerk: float


def quality(controller: float, jitter: float, nodes: tuple[float, ...], bare: bool) -> Quality:
    """Play every course at every rate of the node; return the worst of all."""
    found = []
    for node in nodes:
        how = Stream(
            node,
            controller,
            jitter,
            phase=PHASE,
            seed=int(node + controller),
            **(ONE_POINT if bare else {}),
        )
        for orders, acceleration in COURSES.values():
            seen = worst(run(how, orders, JERK, DURATION)[0], 1.0 / controller)
            found.append(
                Quality(
                    seen.velocity_error / FAST.velocity,
                    seen.acceleration / acceleration,
                    seen.jerk / JERK,
                )
            )
    return Quality(*map(max, zip(*found, strict=True)))


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the quality of the velocity, the acceleration and the jerk for each case."""
    nodes = NODES[:1] if quick else NODES
    for controller in CONTROLLERS[-1:] if quick else CONTROLLERS:
        for jitter in JITTERS[1:2] if quick else JITTERS:
            ours, bare = (quality(controller, jitter, nodes, one) for one in (False, True))
            case = f'controller at {controller:g} Hz, arrival late by up to {jitter * 1e3:g} ms'
            yield Figure(
                f'{case}: error of the velocity',
                '% of 50 mm/s',
                [round(100.0 * ours.velocity, 4)],
                [round(100.0 * bare.velocity, 4)],
                f'≤ {100.0 * VELOCITY:g}',
                ours.velocity <= VELOCITY,
            )
            for name in 'acceleration', 'jerk':
                own, other = getattr(ours, name), getattr(bare, name)
                yield Figure(name, '× limit', [own], [other], f'≤ {LIMIT:g}', own <= LIMIT)
