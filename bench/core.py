# SPDX-License-Identifier: Apache-2.0
"""Update of one axis in a search."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from figures import Figure, alternately, seconds, within
from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig

from homing_node.core.axis import Axis
from homing_node.core.gantry.axis import GantryAxis
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.gantry import follower_parameters
from homing_node.procedures.states import Input

PERIOD = 0.004
#: Cycles of an axis, and then of a gantry.
TURN = 50
#: An axis that searches for as long as a benchmark likes; its feedback may stand still.
ENDLESS = {
    'home_type': 'HSHS',
    'travel': 1e5,
    'homing_velocity_fast': 0.05,
    'following_error': 1e5,
    'timeout': 86400.0,
    'feedback_timeout': 60.0,
    'max_jerk': 100.0,
}


#: The same, but it never stops accelerating.
ACCELERATING = {**ENDLESS, 'homing_velocity_fast_acc': 1e-4, 'homing_velocity_fast_dec': 0.5}


def searching(how: Mapping[str, object] = ENDLESS) -> Axis:
    """Return an axis in its search, 2.4 s after its start."""
    axis = Axis('x', axis_parameters(how), PERIOD)
    for switch in Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH:
        axis.switch(switch, 0.0, False)
    axis.feedback(0.0, 0.0)
    refusal = axis.home(0.0)
    assert refusal is None, refusal
    feed_and_update(axis, 600, start=1)
    assert axis.running and axis.profile.done == (how is ENDLESS)
    return axis


def feed_and_update(axis: Axis, cycles: int, start: int = 0) -> None:
    """Run some cycles: a sample of feedback, where the last command was, and the update."""
    feedback, update, position = axis.feedback, axis.update, 0.0
    for cycle in range(start, start + cycles):
        now = cycle * PERIOD
        feedback(now, position)
        setpoint = update(now)
        if setpoint is not None:
            position, _, _ = setpoint


def searching_gantry() -> GantryAxis:
    """Return a gantry of two in the same search."""
    leader = axis_parameters({**ENDLESS, 'followers': ['x2'], 'max_skew': 1e-3})
    followers = {'x.x2': follower_parameters(leader, 'x2', {})}
    axis = GantryAxis('x', leader, PERIOD, 0.0, followers)
    for drive in axis.drives.values():
        for switch in Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH:
            drive.switch(switch, 0.0, False)
        drive.feedback(0.0, 0.0)
    refusal = axis.home(0.0)
    assert refusal is None, refusal
    feed_and_update_both(axis, 600, start=1)
    assert axis.running and axis.profile.done
    return axis


def feed_and_update_both(axis: GantryAxis, cycles: int, start: int = 0) -> None:
    """Run some cycles: a sample of each side's feedback, and the update."""
    (follower,) = axis.followers
    leads, follows, update, position, beside = (
        axis.feedback,
        follower.feedback,
        axis.update,
        0.0,
        0.0,
    )
    for cycle in range(start, start + cycles):
        now = cycle * PERIOD
        leads(now, position)
        follows(now, beside)
        setpoint = update(now)
        if setpoint is not None:
            position, _, _ = setpoint
            assert follower.setpoint is not None
            beside, _, _ = follower.setpoint


def in_turns(cycles: int) -> tuple[float, float]:
    """Return how long a cycle of an axis and one of a gantry of two take, µs.

    They take turns after a few cycles each: in long blocks a busy machine gives the one a faster
    processor than the other.
    """
    axis, gantry, one, two = searching(), searching_gantry(), 0.0, 0.0
    for start in range(600, 600 + cycles, TURN):
        one += seconds(partial(feed_and_update, axis, TURN, start))
        two += seconds(partial(feed_and_update_both, gantry, TURN, start))
    return one / cycles * 1e6, two / cycles * 1e6


def feed(axis: Axis, cycles: int, start: int = 0) -> None:
    """Give samples of feedback only."""
    feedback = axis.feedback
    for cycle in range(start, start + cycles):
        feedback(cycle * PERIOD, 0.0)


def update(axis: Axis, cycles: int, start: int = 0) -> None:
    """Update only; the feedback stands still."""
    advance = axis.update
    for cycle in range(start, start + cycles):
        advance(cycle * PERIOD)


def bare(cycles: int, read: bool = False) -> None:
    """Run ruckig alone through the same search; ``read`` also reads what it found."""
    otg, given, found = Ruckig(1, PERIOD), InputParameter(1), OutputParameter(1)
    given.control_interface = ControlInterface.Velocity
    given.target_velocity, given.max_acceleration, given.max_jerk = [0.05], [0.5], [100.0]
    advance, take = otg.update, found.pass_to_input
    if not read:
        for _ in range(cycles):
            advance(given, found)
            take(given)
        return
    for _ in range(cycles):
        advance(given, found)
        take(given)
        (found.new_position[0], found.new_velocity[0], found.new_acceleration[0])


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the time of an update, in all and in its parts."""
    cycles, repeats = (500, 3) if quick else (10_000, 15)

    def per_cycle(
        work: Callable[[Axis, int, int], None], how: Mapping[str, object] = ENDLESS
    ) -> float:
        return seconds(partial(work, searching(how), cycles, 600)) / cycles * 1e6

    both, ramp, fed, updated, alone, reading = alternately(
        repeats,
        lambda: per_cycle(feed_and_update),
        lambda: per_cycle(feed_and_update, ACCELERATING),
        lambda: per_cycle(feed),
        lambda: per_cycle(update),
        lambda: seconds(lambda: bare(cycles)) / cycles * 1e6,
        lambda: seconds(lambda: bare(cycles, read=True)) / cycles * 1e6,
    )
    yield within(
        'a sample of feedback and Axis.update, against ruckig.update + pass_to_input',
        'µs',
        both,
        alone,
        15,
    )
    single, two = zip(*(in_turns(cycles) for _ in range(repeats)), strict=True)
    yield within('a gantry of two, against one axis in turns', 'µs', two, single, 2.2)
    yield within('the same while the axis accelerates', 'µs', ramp, alone, 15)
    yield within('Axis.update alone', 'µs', updated, alone, 15)
    yield Figure('Axis.feedback alone', 'µs', fed, alone)
    yield Figure(
        'both, against ruckig with position, velocity and acceleration read', 'µs', both, reading
    )
