# SPDX-License-Identifier: Apache-2.0
"""Samples in, edges at their own time out."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.core.signals import FINEST, Edge, Mark, Switch
from homing_node.core.track import TRACK_LENGTH, Track
from homing_node.core.travel import Leg
from homing_node.procedures.motions import Way
from homing_node.procedures.states import Input

HS = Input.HOME_SWITCH
LIMIT = Input.POSITIVE_LIMIT_SWITCH


def track(*samples):
    one = Track()
    for time, position in samples:
        one.append(time, position)
    return one


# -- the track ----------------------------------------------------------------------------------


def test_a_sample_that_is_not_newer_is_dropped():
    one = Track()
    assert one.append(1.0, 0.1)
    assert not one.append(1.0, 0.2)
    assert not one.append(0.5, 0.3)
    assert one.append(1.5, 0.4)
    assert list(one.samples) == [(1.0, 0.1), (1.5, 0.4)]


def test_the_record_is_bounded():
    one = track(*((float(t), float(t)) for t in range(3 * TRACK_LENGTH)))
    assert len(one.samples) == TRACK_LENGTH
    assert one.position == 3 * TRACK_LENGTH - 1


def test_velocity_and_interval_of_the_newest_samples():
    assert track().velocity == track((0.0, 1.0)).velocity == 0.0
    assert track().interval == 0.0
    assert track((0.0, 5.0), (1.0, 1.0), (1.5, 2.0)).velocity == 2.0
    assert track((0.0, 5.0), (1.0, 1.0), (1.5, 2.0)).interval == 0.5


@pytest.mark.parametrize(
    ('time', 'position'),
    [(-1.0, 0.0), (0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (3.0, 1.5), (4.0, 2.0), (6.0, 4.0)],
)
def test_the_position_at_a_time(time, position):
    one = track((0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (4.0, 2.0), (6.0, 4.0))
    assert one.covers(time)
    assert one.at(time) == position


def test_a_time_behind_the_newest_reading_is_not_covered():
    assert not track((0.0, 0.0), (1.0, 1.0)).covers(1.5)


def test_a_time_is_not_covered_without_two_readings():
    assert not track().covers(0.0)
    assert not track((0.0, 1.0)).covers(0.0)


def test_the_extent_between_two_times_knows_a_turn_between_them():
    one = track((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 1.0), (4.0, -1.0))
    assert one.extent(0.5, 0.5) == (0.5, 0.5)
    assert one.extent(0.5, 1.5) == (0.5, 2.0)
    assert one.extent(1.5, 2.5) == (2.0, 3.0)
    assert one.extent(0.5, 3.5) == (0.0, 3.0)


def test_spread():
    one = track((0.0, 9.0), (1.0, 1.0), (2.0, 3.0), (3.0, 2.0))
    assert one.spread(since=1.0) == 2.0
    assert one.spread(since=2.5) == 0.0


def test_mirrored_track():
    one = track((0.0, 1.0), (1.0, 2.0))
    one.mirror()
    assert list(one.samples) == [(0.0, -1.0), (1.0, -2.0)]
    assert one.position == -2.0


# -- edges --------------------------------------------------------------------------------------


def located(time, *samples):
    edge = Edge(HS, time, True)
    edge.locate(track(*samples))
    return edge


def test_the_position_is_interpolated_at_the_edges_own_time():
    edge = located(1.25, (-1.0, 1e-9), (0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 9.0))
    assert edge.position == 1.5
    assert edge.uncertainty == pytest.approx(2.0)  # a corner: half of 9 - 2 * 3 + 1
    assert edge.resolved


def test_two_equal_samples_do_not_make_an_edge_certain():
    """The feedback stood for an interval, of an axis that moves: the edge's time still counts."""
    edge = Edge(HS, 2.5, True, doubt=0.5)
    edge.locate(track((0.0, 0.0), (1.0, 1e-9), (2.0, 1.0), (3.0, 1.0), (4.0, 2.0)))
    assert edge.uncertainty == pytest.approx(1.0)  # 0.5 s at 1 m/s and a corner: an interval


def test_a_doubtful_time_is_not_capped_by_an_interval_of_the_feedback():
    edge = Edge(HS, 1.5, True, doubt=5.0)
    edge.locate(track((0.0, 0.0), (1e-9, 1e-12), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)))
    assert edge.uncertainty == pytest.approx(5.0, abs=1e-6)


def test_samples_that_came_together_do_not_make_the_axis_quick():
    """Their times are those of their arrival: 1 m/s, though two are 1 ms apart."""
    edge = Edge(HS, 1.5, True, doubt=1.0)
    edge.locate(track((0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (2.001, 3.0)))
    assert edge.uncertainty < 4.0


def test_the_count_of_an_encoder_is_its_smallest_step():
    one = track((0.0, 0.3), (1.0, 0.3), (2.0, 0.5), (3.0, 0.6), (4.0, 0.9))
    assert one.grain == pytest.approx(0.1)


def test_an_edge_newer_than_the_feedback_is_extrapolated_until_it_is_covered():
    one = track((0.0, 0.0), (1.0, 1.0))
    edge = Edge(HS, 1.5, True)
    assert not edge.locate(one)
    assert edge.position == 1.5
    assert not edge.resolved
    one.append(2.0, 3.0)
    assert edge.locate(one)
    assert edge.position == 2.0
    assert not edge.resolved
    one.append(3.0, 4.0)
    assert edge.locate(one)
    assert edge.resolved


def test_an_edge_older_than_the_record_is_where_the_record_begins():
    assert located(-5.0, (0.0, 2.0), (1.0, 3.0)).position == 2.0


def test_late_feedback_changes_nothing():
    early, late = Edge(HS, 1.3, True), Edge(HS, 1.3, True)
    samples = [(0.0, 0.0), (1.0, 1.0), (1.5, 1.2), (2.0, 4.0)]
    one = Track()
    for sample in samples[:2]:
        one.append(*sample)
    early.locate(one)
    for sample in samples[2:]:
        one.append(*sample)
    early.locate(one)
    late.locate(track(*samples))
    assert (early.position, early.uncertainty) == (late.position, late.uncertainty)


def test_a_coarse_encoder_is_uncertain_by_its_count():
    edge = located(2.5, (0.0, 0.0), (1.0, 0.1), (2.0, 0.1), (3.0, 0.1), (4.0, 0.2))
    assert edge.position == 0.1
    assert edge.uncertainty == pytest.approx(0.1)


def test_an_axis_that_never_moved_is_certain():
    assert located(1.0, (0.0, 0.1), (2.0, 0.1)).uncertainty == FINEST


def test_edges_are_ordered_by_time_a_limit_first():
    hs, limit, later = Edge(HS, 1.0, True), Edge(LIMIT, 1.0, True), Edge(LIMIT, 1.1, True)
    assert sorted([later, hs, limit], key=lambda e: e.order) == [limit, hs, later]


def test_a_mark_is_certain():
    mark = Mark(0.5)
    assert mark.resolved
    assert mark.uncertainty == FINEST


# -- the way of travel --------------------------------------------------------------------------

#: Told at 1.0 s to turn, overruns until 1.2 s, then goes away; a noise of 0.01.
TURN = track(
    (0.8, 0.8),
    (0.9, 0.89),
    (1.0, 0.97),
    (1.1, 1.0),
    (1.2, 1.01),
    (1.3, 1.0),
    (1.4, 0.9),
    (1.5, 0.91),
    (1.6, 0.8),
)
TOWARD = Leg(Way.TOWARD, 0.0, 0.0, since=0.0)
TURNING = Leg(Way.AWAY, 0.97, 0.98, since=1.0, before=TOWARD)


@pytest.mark.parametrize(
    ('time', 'way'),
    [(0.85, 1), (1.05, 1), (1.19, 1), (1.21, -1), (1.25, -1), (1.45, -1), (1.6, -1)],
)
def test_the_way_changes_where_the_feedback_turned(time, way):
    """Not where the command did, and not with every noise."""
    assert TURNING.way_at(time, TURN) == way


@pytest.mark.parametrize(
    ('samples', 'turn'),
    [
        ([(1.0, 1.0), (2.0, 2.0), (3.0, 1.0)], 2.0),
        ([(1.0, 1.0), (2.0, 2.0), (3.0, 1.5)], 2.0 + 1 / 6),
        ([(1.0, 1.0), (2.0, 2.0), (3.0, 2.0), (4.0, 0.0)], 2.5),  # a coarse encoder
        ([(1.0, 2.0), (2.0, 1.0)], 1.0),
    ],
)
def test_where_between_the_samples_it_turned(samples, turn):
    leg = Leg(Way.AWAY, 0.0, 0.0, since=1.0, before=TOWARD)
    assert leg.way_at(turn - 1e-6, track(*samples)) == 1
    assert leg.way_at(turn + 1e-6, track(*samples)) == -1


@pytest.mark.parametrize(('time', 'way'), [(0.95, 0), (1.0, -1), (1.05, -1)])
def test_the_way_from_rest(time, way):
    assert Leg(Way.AWAY, 0.97, 0.97, since=1.0).way_at(time, TURN) == way


def test_a_late_feedback_still_travels_the_old_way():
    assert TURNING.way_at(0.9, track((0.8, 0.8), (0.9, 0.89))) == 1


def test_while_it_overruns_only_its_newest_stretch_is_unknown():
    overrunning = track((0.9, 0.89), (1.0, 0.97), (1.1, 1.0))
    assert TURNING.way_at(0.95, overrunning) == TURNING.way_at(1.0, overrunning) == 1
    assert TURNING.way_at(1.05, overrunning) is None


@pytest.mark.parametrize('last', range(4, 20))
def test_equal_samples_are_no_turn(last):
    """A coarse encoder, 1 count every 4 samples: the axis still goes the old way."""
    steps = track(*((0.1 * i, i // 4) for i in range(last)))
    leg = Leg(Way.AWAY, 0.0, 0.0, since=0.15, before=TOWARD)
    assert leg.way_at(0.1 * (last - 1), steps) is None


# -- a switch -----------------------------------------------------------------------------------


def fed(switch, *messages):
    """Feed (time, signal); return (time, rises) of the edges."""
    edges = [switch.set(time, signal, time) for time, signal in messages]
    return [(e.time, e.rises) for e in edges if e]


def test_the_first_message_is_a_level_not_an_edge():
    switch = Switch(HS)
    assert switch.level is None
    assert fed(switch, (0.0, True)) == []
    assert switch.level is True


def test_edges_without_debounce():
    assert fed(Switch(HS), (0.0, False), (1.0, True), (1.5, True), (2.0, False)) == [
        (1.0, True),
        (2.0, False),
    ]


def test_polarity():
    switch = Switch(HS, inverted=True)
    assert fed(switch, (0.0, True), (1.0, False)) == [(1.0, True)]


def test_debounce_uses_the_first_edge_and_counts_bounces():
    switch = Switch(HS, debounce=0.1)
    assert fed(switch, (0.0, False), (1.0, True), (1.02, False), (1.04, True)) == []
    assert switch.level is False
    assert switch.unsettled
    assert switch.poll(1.1) is None
    edge = switch.poll(1.15)
    assert (edge.time, edge.rises) == (1.0, True)
    assert switch.level is True
    assert switch.bounces == 2
    assert not switch.unsettled


def test_without_a_debounce_changes_that_follow_at_once_are_bounces():
    switch = Switch(HS)
    fed(switch, (0.0, False), (1.0, True), (1.001, False), (1.002, True), (1.1, False))
    assert switch.bounces == 2


def test_a_glitch_shorter_than_the_debounce_is_no_edge():
    switch = Switch(HS, debounce=0.1)
    assert fed(switch, (0.0, False), (1.0, True), (1.05, False)) == []
    assert switch.poll(2.0) is None
    assert switch.level is False
    assert not switch.unsettled
    assert switch.bounces == 1


def test_a_message_confirms_what_lasted_before_it():
    switch = Switch(HS, debounce=0.1)
    assert fed(switch, (0.0, False), (1.0, True), (2.0, False)) == [(1.0, True)]
    edge = switch.poll(2.2)
    assert (edge.time, edge.rises) == (2.0, False)


def test_a_bounce_that_arrives_late_is_still_a_bounce():
    """Messages that all travel longer than the debounce."""
    switch = Switch(HS, debounce=0.01)
    delay = 0.05
    switch.set(0.0, False, delay)
    for time, signal in ((1.0, True), (1.002, False), (1.004, True)):
        assert switch.set(time, signal, time + delay) is None
        assert switch.poll(time + delay + 0.001) is None
    edge = switch.poll(1.02 + delay)
    assert (edge.time, edge.rises) == (1.0, True)


def test_a_bounce_whose_messages_come_apart_begins_at_its_first_edge():
    """Between two of its messages passes more than the debounce, between its edges less."""
    switch = Switch(HS, debounce=0.003)
    switch.set(0.0, False, 0.0)
    assert switch.set(1.0, True, 1.004, doubt=0.1) is None
    assert switch.set(1.0012, False, 1.005) is None
    assert switch.poll(1.0085) is None
    assert switch.set(1.0024, True, 1.010) is None
    edge = switch.poll(1.014)
    assert (edge.opening.end, edge.rises, edge.opening.doubt) == (1.0, True, 0.1)


def test_reordered_messages_do_not_lose_the_level():
    switch = Switch(HS)
    fed(switch, (0.0, False), (2.0, True))
    switch.set(1.0, False, 2.1)
    assert switch.level is False


@given(
    st.lists(st.tuples(st.floats(0.001, 0.2), st.booleans()), max_size=40),
    st.sampled_from([0.0, 0.05]),
)
def test_edges_alternate_and_end_at_the_last_level(messages, debounce):
    switch, time = Switch(HS, debounce=debounce), 0.0
    switch.set(0.0, False, 0.0)
    level, edges = False, []
    for wait, level in messages:
        time += wait
        edges += [switch.set(time, level, time)]
    edges = [e for e in [*edges, switch.poll(time + 1.0)] if e]
    assert switch.level is level
    assert [e.rises for e in edges] == [i % 2 == 0 for i in range(len(edges))]
    assert [e.time for e in edges] == sorted(e.time for e in edges)


@pytest.mark.parametrize('level', [False, True])
def test_a_changed_polarity_turns_the_known_level(level):
    switch = Switch(Input.HOME_SWITCH)
    switch.turn(True)
    assert switch.level is None
    switch.turn(False)
    switch.set(1.0, level, 1.0)
    switch.turn(True)
    assert switch.level is not level
    assert switch.set(2.0, level, 2.0) is None  # the same level on the wire is no edge
    edge = switch.set(3.0, not level, 3.0)
    assert edge.rises is level
    switch.turn(True)
    assert switch.level is level
