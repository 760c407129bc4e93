# SPDX-License-Identifier: Apache-2.0
"""A gantry beside single axes in one request: its group ends once it is square."""

import pytest
from gantry_rig import Gantry, SideRig

from homing_node.core.dispatch import Dispatch
from homing_node.procedures.states import Error

#: z homes first, then x and the gantry y together, then w.
GROUPS = (('z',), ('x', 'y'), ('w',))


class Machine:
    """Three axes and a gantry, homed by one request; all have the same time."""

    def __init__(self, **side):
        self.rigs = {name: Gantry('HSHS', (SideRig(),)) for name in 'zxw'}
        self.rigs['y'] = Gantry('HSHS', (SideRig(), SideRig(skew=0.0015, **side)))
        axes = {name: rig.axis for name, rig in self.rigs.items()}
        self.dispatch = Dispatch(axes, GROUPS, lambda name: None, object)
        self.seen = []  # which axes run, in each cycle
        for _ in range(60):
            self._cycle()
        self.request = self.dispatch.home(list(axes), 'test', self.time)

    @property
    def time(self):
        return self.rigs['y'].time

    def _cycle(self):
        for rig in self.rigs.values():
            rig.cycle()

    def run(self, until=lambda: False):
        """Let time pass until the request has ended."""
        end = self.time + 30.0
        while not (self.request.done or until()):
            self._cycle()
            self.dispatch.update(self.time)
            running = {name for name, rig in self.rigs.items() if rig.axis.running}
            if running and running != (self.seen or [None])[-1]:
                self.seen.append(running)
            assert self.time < end

    def errors(self):
        return {name: one.error for name, one in self.request.outcomes.items()}

    def squareness(self):
        return abs(self.rigs['y'].skews[0])


def test_a_group_ends_once_its_gantry_is_square():
    """The axis beside it has homed long before; the next group waits for the squaring."""
    machine = Machine()
    machine.run()
    assert machine.request.success
    assert machine.seen == [{'z'}, {'x', 'y'}, {'y'}, {'w'}]
    assert machine.squareness() < 6e-5
    assert [rig.axis.homed for rig in machine.rigs.values()] == [True] * 4


def test_a_gantry_that_fails_stops_the_axis_beside_it():
    machine = Machine(stuck={'home_switch': False})
    machine.rigs['x'].plants[0].position -= 0.03  # it homes longer than the gantry
    for _ in range(60):
        machine._cycle()
    machine.run()
    assert machine.errors() == {
        'z': Error.NoError,
        'x': Error.Canceled,
        'y': Error.FollowerSwitchMissing,
        'w': Error.Canceled,
    }
    assert 'axis y was not homed' in machine.request.outcomes['w'].message
    assert not any(rig.axis.running for rig in machine.rigs.values())
    assert machine.seen[-1] in ({'x'}, {'x', 'y'}), machine.seen


@pytest.mark.parametrize('state', ['Squaring', 'Proving'])
def test_an_axis_that_fails_stops_the_gantry_beside_it(state):
    """Also while a follower moves alone; the gantry is not homed."""
    machine = Machine()
    x, y = machine.rigs['x'].axis, machine.rigs['y'].axis
    machine.run(until=lambda: x.running and y.state == 'HSSearch' and y.profile.velocity)
    hold = machine.rigs['x']
    hold.on_message = lambda *_: False  # x does not see its switch: it is still on its way
    machine.run(until=lambda: y.state == state)
    assert x.running
    x.stop(Error.EmergencyStop, 'test')
    machine.run()
    assert machine.errors()['y'] is Error.Canceled
    assert machine.errors()['x'] is Error.EmergencyStop
    assert not y.homed and not y.running
    assert all(follower.profile is None for follower in y.followers)
