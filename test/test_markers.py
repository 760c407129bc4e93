# SPDX-License-Identifier: Apache-2.0
"""What RViz shows of the axes."""

import math

import pytest
from core_rig import HS, rig
from visualization_msgs.msg import Marker

from homing_node.ros.markers import RADIUS, Markers


class Shown:
    """The markers of one rehearsed axis; what is published is kept."""

    def __init__(self, made, frame='<joint>'):
        self.made, self.published = made, []
        self.markers = Markers(
            self, {'x': made.axis}, {'x': 'joint_x'}, frame, lambda publish: publish()
        )

    def publish(self, message):
        self.published.append(message)

    def home(self):
        self.made.axis.home(self.made.time)
        while self.made.axis.running:
            self.made.cycle()
            self.markers.state(self.made.axis, 2_000_000_000)


@pytest.mark.parametrize('direction', [1, -1])
def test_switches_and_home_are_shown_after_a_run(direction):
    shown = Shown(rig('HSHS').rehearsal(direction), '<axis>_<joint>_rail')
    for _ in range(5):
        shown.made.cycle()
    shown.markers.state(shown.made.axis, 1)
    assert shown.published == []
    shown.home()
    (message,) = shown.published
    first, *marks = message.markers
    assert first.action == Marker.DELETEALL
    assert {one.header.frame_id for one in marks} == {'x_joint_x_rail'}
    assert {one.header.stamp.sec for one in marks} == {2}
    assert len({(one.ns, one.id) for one in marks}) == len(marks)
    assert all(one.scale.x > 0.0 and one.pose.orientation.w == 1.0 for one in marks)
    places = {one.text: one.pose.position.x for one in marks if one.text}
    home = shown.made.axis.outcome.home_position_raw
    (at_home,) = [one for text, one in places.items() if text.startswith(f'x: home {home:.4f}')]
    assert at_home == home
    assert places['x: home switch on'] == pytest.approx(direction * 0.06, abs=1e-3)
    assert 'x: home switch off' in places and HS == 'home_switch'
    spheres = [one for one in marks if one.type == Marker.SPHERE]
    assert len(spheres) == len(places)


def test_nothing_is_shown_twice_and_a_lost_home_is_gone():
    shown = Shown(rig('HS').rehearsal())
    for _ in range(5):
        shown.made.cycle()
    shown.home()
    axis = shown.made.axis
    shown.markers.state(axis, 3)
    assert len(shown.published) == 1
    axis.forget_home()
    shown.markers.state(axis, 4)
    assert len(shown.published) == 2
    assert not any('home 0' in one.text for one in shown.published[-1].markers)


def test_a_rotary_axis_turns_about_z():
    one = rig('HS', unit='rad')
    shown = Shown(one.rehearsal())
    for _ in range(5):
        shown.made.cycle()
    shown.home()
    home = shown.made.axis.outcome.home_position_raw
    (mark,) = [m for m in shown.published[-1].markers if 'home 0' in m.text]
    assert mark.text.endswith(' rad')
    place = mark.pose.position
    assert (place.x, place.y) == pytest.approx((RADIUS * math.cos(home), RADIUS * math.sin(home)))
