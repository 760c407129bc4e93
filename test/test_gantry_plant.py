# SPDX-License-Identifier: Apache-2.0
"""The simulated gantry alone: masses, springs, drives; no ROS, no clock."""

from math import exp, pi, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.plant.gantry import Gantry, Side, plants
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored, sides_of
from homing_node.plant.racking import FRICTION, SERVO, exponential
from homing_node.plant.simulated_axis import SimulatedAxis

STEP = 0.001
#: What drives of this size can hold against a spring, N.
FORCE = 2000.0
STOPS = (-0.01, 0.21)
HOME = 'home_switch'


def layout(stiffness=1e6, start=0.1, skew=0.0, switches=None, **follower):
    """Return a gantry of two sides that stands skewed."""
    switches = switches or {}
    other = AxisLayout(STOPS, switches, start=start + skew, stiffness=stiffness, **follower)
    return AxisLayout(STOPS, switches, start=start, followers={'y.y2': other})


def gantry(*args, friction=FRICTION, **kwargs):
    made = Gantry('y', layout(*args, **kwargs), friction=friction)
    return made, *made.sides.values()


def pass_time(sides, seconds, *ways):
    """Let time pass; ``ways`` tell each side's command at a time, where it has a new one."""
    found = {side: [] for side in sides}
    for n in range(1, round(seconds / STEP) + 1):
        for side, way in zip(sides, ways, strict=False):
            side.follow(way(n * STEP), over=STEP)
        for side in sides:
            found[side] += side.step(STEP)
    return list(found.values())


# -- the springs ----------------------------------------------------------------------------------


@pytest.mark.parametrize('stiffness', [0.0, 1e4, 1e6, 1e8])
def test_drives_hold_a_skewed_gantry_where_it_is(stiffness):
    g, leader, follower = gantry(stiffness, skew=0.002)
    pass_time((leader, follower), 0.5)
    assert (leader.position, follower.position) == pytest.approx((0.1, 0.102), abs=1e-12)
    assert follower.force == pytest.approx(stiffness * 0.002, rel=1e-9)
    assert leader.force == 0.0
    assert g.racked == pytest.approx([0.002])


@pytest.mark.parametrize('stiffness', [1e4, 1e6, 1e8])
@pytest.mark.parametrize('off', [(1,), (0,), (0, 1)], ids=['follower', 'leader', 'both'])
def test_it_springs_back_when_a_servo_is_off(stiffness, off):
    skew = min(0.002, FORCE / stiffness)
    g, *sides = gantry(stiffness, skew=skew)
    for number in off:
        sides[number].servo(False)
    pass_time(sides, 3.0)
    assert g.racked == pytest.approx([0.0], abs=2e-6)
    assert g.forces == pytest.approx([0.0], abs=2e-6 * stiffness)
    if off == (1,):  # the leader holds its place, and the follower comes to it
        assert [side.position for side in sides] == pytest.approx([0.1, 0.1], abs=2e-6)
    if off == (0,):
        assert [side.position for side in sides] == pytest.approx([0.1 + skew] * 2, abs=2e-6)
    if len(off) == 2:  # equal masses meet half-way
        assert [side.position for side in sides] == pytest.approx([0.1 + skew / 2] * 2, abs=2e-6)


def test_a_side_without_a_spring_stays_where_its_servo_goes_off():
    _, leader, follower = gantry(0.0, skew=0.002)
    follower.servo(False)
    pass_time((leader, follower), 1.0)
    assert follower.position == pytest.approx(0.102, abs=1e-12)


def test_a_free_gantry_swings_at_its_own_frequency():
    """Two masses m and a spring k: the skew swings with sqrt(2 k / m)."""
    stiffness, mass, skew = 1e4, 50.0, 0.002
    g, *sides = gantry(stiffness, skew=skew, friction=0.0)
    for side in sides:
        side.servo(False)
    damping = 0.05
    own = sqrt(2.0 * stiffness / mass)
    swing = own * sqrt(1.0 - damping**2)
    pass_time(sides, round(2.0 * pi / swing, 3))
    time = sides[0].time
    beside = exp(-damping * own * time)
    assert g.racked[0] == pytest.approx(skew * beside, rel=1e-3)


@pytest.mark.parametrize('masses', [(10.0, 10.0), (5.0, 40.0)])
@pytest.mark.parametrize('stiffness', [1e3, 1e6, 1e8])
def test_springs_keep_the_momentum(stiffness, masses):
    made = layout(stiffness, skew=0.002, mass=masses[1])._replace(mass=masses[0])
    g = Gantry('y', made, friction=0.0)
    sides = list(g.sides.values())
    pass_time(sides, 0.3, lambda t: 0.1 + 0.05 * t, lambda t: 0.102 + 0.05 * t)
    for side in sides:
        side.servo(False)
    before = g.momentum
    assert before == pytest.approx(0.05 * sum(masses), rel=1e-6)
    pass_time(sides, 0.5)
    assert g.momentum == pytest.approx(before, rel=1e-6)
    assert sides[0].position == pytest.approx(0.1 + 0.05 * 0.8, abs=0.003)


def test_guides_slow_a_free_gantry_down():
    g, *sides = gantry(1e6)
    pass_time(sides, 0.3, lambda t: 0.1 + 0.05 * t, lambda t: 0.1 + 0.05 * t)
    for side in sides:
        side.servo(False)
    momentum = g.momentum
    pass_time(sides, 0.1)
    assert g.momentum == pytest.approx(momentum * exp(-1.0), rel=1e-6)
    pass_time(sides, 2.0)
    assert sides[0].position == pytest.approx(0.1 + 0.05 * 0.3 + 0.05 / 10.0, abs=1e-6)


@pytest.mark.parametrize('stiffness', [1e3, 1e5, 1e8])
def test_no_energy_comes_from_nowhere(stiffness):
    g, *sides = gantry(stiffness, skew=0.002)
    for side in sides:
        side.servo(False)
    energy = at_first = g.energy
    assert energy == pytest.approx(0.5 * stiffness * 0.002**2)
    for _ in range(300):
        pass_time(sides, STEP)
        assert g.energy <= energy + 1e-9 * at_first
        energy = g.energy


@pytest.mark.parametrize('stiffness', [1e4, 1e6, 1e8])
def test_a_step_is_exact_however_long_it_is(stiffness):
    ends = []
    for step in (0.001, 0.004):
        made = Gantry('y', layout(stiffness, skew=min(0.002, FORCE / stiffness)))
        sides = list(made.sides.values())
        sides[1].servo(False)
        for _ in range(round(0.2 / step)):
            for side in sides:
                side.step(step)
        ends.append([side.position for side in sides])
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_the_exponential_of_a_turn():
    turn = exponential([[0.0, -40.0 * pi], [40.0 * pi, 0.0]])
    assert [value for row in turn for value in row] == pytest.approx([1, 0, 0, 1], abs=1e-9)


# -- the drives -----------------------------------------------------------------------------------


def test_sides_that_go_together_go_as_a_single_axis():
    """Nothing pulls at a gantry that is square: each side is where a single axis would be."""
    g = Gantry('y', layout(1e8, lag=0.005)._replace(lag=0.005))
    sides = list(g.sides.values())
    alone = SimulatedAxis(AxisLayout(STOPS, {}, start=0.1, lag=0.005))

    def way(t):
        return 0.1 + 0.05 * t

    for n in range(1, 400):
        for one in (*sides, alone):
            one.follow(way(n * STEP), over=STEP)
        for one in (*sides, alone):
            one.step(STEP)
        assert [side.position for side in sides] == pytest.approx([alone.position] * 2, abs=1e-15)
        assert [side.command for side in sides] == [alone.command] * 2


@pytest.mark.parametrize('stiffness', [0.0, 1e4, 1e6])
def test_a_squaring_move_ends_where_it_is_told(stiffness):
    g, *sides = gantry(stiffness, skew=0.002)

    def back(t):
        return 0.102 - 0.002 * min(t / 0.5, 1.0)

    pass_time(sides, 2.0, lambda t: 0.1, back)
    assert [side.position for side in sides] == pytest.approx([0.1, 0.1], abs=1e-8)
    assert g.forces == pytest.approx([0.0], abs=0.01)


def test_the_stiffer_the_gantry_the_less_a_drive_moves_one_side():
    reached = []
    for stiffness in (1e4, 1e6, 1e8):
        g, *sides = gantry(stiffness)
        pass_time(sides, 0.1, lambda t: 0.1, lambda t: 0.1 + 0.02 * t)
        reached.append(g.racked[0])
    assert reached[0] == pytest.approx(0.002, rel=0.02)
    assert reached[0] > reached[1] > 2.0 * reached[2] > 0.0


def test_a_later_side_stays_behind_by_its_delay():
    """50 ms at 50 mm/s are 2.5 mm."""
    g, *sides = gantry(1e4, delay=0.05)
    pass_time(sides, 1.0, lambda t: 0.1 + 0.05 * t, lambda t: 0.1 + 0.05 * t)
    assert g.racked == pytest.approx([-0.0025], abs=1e-6)
    assert g.forces == pytest.approx([-25.0], rel=1e-3)
    pass_time(sides, 0.5)
    assert g.racked == pytest.approx([0.0], abs=1e-6)


def test_a_lagging_side_stays_behind_by_its_lag():
    g, *sides = gantry(1e4, lag=0.02)
    pass_time(sides, 1.0, lambda t: 0.1 + 0.05 * t, lambda t: 0.1 + 0.05 * t)
    assert g.racked == pytest.approx([-0.001], abs=1e-6)


def test_a_servo_that_comes_on_holds_its_side_there():
    g, leader, follower = gantry(1e6, skew=0.002)
    follower.servo(False)
    assert follower.enabled is False and leader.enabled is True
    follower.follow(0.15, over=STEP)  # a drive that is off takes none
    pass_time((leader, follower), 2.0)
    follower.servo(True)
    pass_time((leader, follower), 0.5)
    assert follower.position == follower.command == pytest.approx(0.1, abs=1e-6)
    assert g.forces == pytest.approx([0.0], abs=1.0)


def test_a_command_on_its_way_is_lost_when_the_servo_goes_off():
    _, leader, follower = gantry(0.0, delay=0.05)
    follower.follow(0.15, over=STEP)
    follower.servo(False)
    follower.servo(True)
    pass_time((leader, follower), 0.2)
    assert follower.position == 0.1


def test_a_hard_stop_holds_a_side():
    g, *sides = gantry(1e5, start=0.2)
    pass_time(sides, 0.5, lambda t: 0.2 + 0.05 * t, lambda t: 0.2 + 0.05 * t)
    assert [side.position for side in sides] == [0.21, 0.21]
    g, *sides = gantry(1e5, start=0.2, skew=0.009)  # nothing to spring beyond
    sides[0].servo(False)
    pass_time(sides, 1.0)
    assert max(side.position for side in sides) <= 0.21
    assert g.racked == pytest.approx([0.0], abs=1e-5)


def test_a_side_stands_within_its_hard_stops():
    with pytest.raises(ValueError, match=r'position 0\.5 is beyond the hard stops'):
        Gantry('y', layout(), {'y.y2': 0.5})
    g = Gantry('y', layout(), {'y.y2': 0.101})
    assert g.racked == pytest.approx([0.001])


# -- what each side sees --------------------------------------------------------------------------


def test_each_side_has_switches_of_its_own():
    switches = {HOME: SwitchLayout(0.15, 0.16)}
    made = layout(1e4, switches=switches)
    other = made.followers['y.y2']._replace(switches={HOME: SwitchLayout(0.1503, 0.1603)})
    sides = list(Gantry('y', made._replace(followers={'y.y2': other})).sides.values())
    ways = [lambda t: 0.1 + 0.1 * t] * 2
    first, second = pass_time(sides, 0.55, *ways)
    assert [(h.input, h.value, h.position) for h in first] == [(HOME, True, 0.15)]
    assert [(h.input, h.value, h.position) for h in second] == [(HOME, True, 0.1503)]
    assert second[0].time - first[0].time == pytest.approx(0.003, abs=1e-6)
    assert sides[0].levels() == {HOME: True}


def test_a_mirrored_side_counts_the_other_way():
    """Square at -(0.1 + 0.002), the spring as slack as that of one that counts the same way."""
    other = AxisLayout(
        (-0.22, 0.02), {}, start=-0.102, stiffness=1e6, square_at=0.002, mirrored=True
    )
    g = Gantry('y', AxisLayout(STOPS, {}, start=0.1, followers={'y.y2': other}))
    leader, follower = g.sides.values()
    assert g.racked == pytest.approx([0.0])
    pass_time((leader, follower), 0.5, lambda t: 0.1 + 0.05 * t, lambda t: -0.102 - 0.05 * t)
    assert g.racked == pytest.approx([0.0], abs=1e-12)
    assert (leader.position, follower.position) == pytest.approx((0.125, -0.127))
    pass_time((leader, follower), 0.5, lambda t: 0.125, lambda t: -0.127 - 0.001 * min(1.0, 4 * t))
    pass_time((leader, follower), 0.5)
    assert g.forces == pytest.approx([1000.0], rel=1e-4)  # it is ahead, along the leader
    follower.servo(False)
    pass_time((leader, follower), 2.0)
    assert follower.position == pytest.approx(-0.127, abs=1e-6)


@settings(max_examples=20)
@given(
    skew=st.floats(-0.002, 0.002),
    stiffness=st.sampled_from([0.0, 1e3, 1e5, 1e7]),
    off=st.sets(st.integers(0, 2)),
)
def test_a_mirrored_gantry_does_the_mirrored_thing(skew, stiffness, off):
    made = layout(stiffness, skew=skew)
    third = made.followers['y.y2']._replace(start=0.1, mass=20.0)
    made = made._replace(followers={**made.followers, 'y.y3': third})
    places = []
    for one in (made, mirrored(made)):
        sides = list(Gantry('y', one).sides.values())
        for number in off:
            sides[number].servo(False)
        pass_time(sides, 0.05)
        places.append([side.position for side in sides])
    assert places[0] == pytest.approx([-place for place in places[1]], abs=1e-12)


def test_three_followers_hang_on_the_leader():
    follower = layout(1e5).followers['y.y2']
    made = AxisLayout(
        STOPS,
        {},
        start=0.1,
        followers={
            'y.y2': follower,
            'y.y3': follower._replace(start=0.101),
            'y.y4': follower._replace(start=0.099),
        },
    )
    g = Gantry('y', made)
    sides = list(g.sides.values())
    assert g.forces == pytest.approx([0.0, 100.0, -100.0])
    sides[2].servo(False)
    pass_time(sides, 2.0)
    assert g.forces == pytest.approx([0.0, 0.0, -100.0], abs=0.2)
    assert [side.position for side in sides] == pytest.approx([0.1, 0.1, 0.1, 0.099], abs=2e-6)


def test_what_simulates_the_axes_of_a_machine():
    layouts = {'x': AxisLayout(STOPS, {}), 'y': layout()}
    found = plants(layouts)
    assert list(found) == list(sides_of(layouts)) == ['x', 'y', 'y.y2']
    assert type(found['x']) is SimulatedAxis
    assert type(found['y']) is type(found['y.y2']) is Side


def test_the_servo_is_slower_than_a_step():
    """Else a step of the rehearsal could not show how a side leaves its command."""
    assert SERVO * STEP < 1.0
