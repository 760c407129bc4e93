# SPDX-License-Identifier: Apache-2.0
"""Groups of axes: order, failure, cancellation."""

import pytest
from core_rig import rig

from homing_node.core.outcome import Outcome, together
from homing_node.core.request import Request
from homing_node.procedures.states import Error, State


class FakeAxis:
    """An axis whose runs end when the test says so."""

    def __init__(self, name):
        self.name = name
        self.running = False
        self.refused = None
        self.outcome = Outcome(Error.NoError)
        self.canceled = 0
        self.runs = 0
        self.state = State.Idle
        self.parameters = rig('HS').parameters()
        self.drives = {name: self}

    @property
    def ended(self):
        return self.outcome

    def refusal(self, now, verify=False):
        return self.refused

    def home(self, now, verify=False):
        assert not self.running
        self.running = True
        self.runs += 1
        self.state = State.HSSearch

    def cancel(self):
        self.canceled += 1

    def end(self, error=Error.NoError):
        assert self.running
        self.running = False
        self.state = State.Idle
        self.outcome = Outcome(error, f'axis {self.name}: …', 1.0, 1.0, 0.1)


@pytest.fixture
def axes():
    return {name: FakeAxis(name) for name in 'xyz'}


def ready(name):
    return None


def running(axes):
    return ''.join(name for name, axis in axes.items() if axis.running)


def errors(request):
    return {name: str(outcome.error) for name, outcome in request.outcomes.items()}


def test_groups_one_after_another(axes):
    request = Request([['z'], ['x', 'y']], axes, 'owner', ready)
    assert request.names == ('z', 'x', 'y')
    request.start(0.0)
    assert running(axes) == 'z'
    assert not request.update(0.1)
    axes['z'].end()
    assert not request.update(0.2)
    assert running(axes) == 'xy'
    axes['y'].end()
    assert not request.update(0.3)
    assert running(axes) == 'x'
    assert not request.success
    axes['x'].end()
    assert request.update(0.4)
    assert request.done
    assert request.success
    assert set(request.outcomes) == set('xyz')
    assert not any(axis.canceled for axis in axes.values())


def test_one_that_fails_stops_its_group_and_later_ones_do_not_start(axes):
    request = Request([['x', 'y'], ['z']], axes, 'owner', ready)
    request.start(0.0)
    axes['x'].end(Error.LSTriggered)
    assert not request.update(0.1)
    assert axes['y'].canceled
    axes['y'].end(Error.Canceled)
    assert request.update(0.2)
    assert axes['z'].runs == 0
    assert errors(request) == {'x': 'LSTriggered', 'y': 'Canceled', 'z': 'Canceled'}
    assert request.outcomes['z'].message == (
        'axis z: not started: axis x was not homed (LSTriggered)'
    )
    assert not request.success


def test_one_that_is_refused_keeps_its_whole_group_from_starting(axes):
    axes['y'].refused = Outcome(Error.SwitchUnknown, 'axis y: …')
    request = Request([['x', 'y'], ['z']], axes, 'owner', ready)
    request.start(0.0)
    assert request.done
    assert not any(axis.runs for axis in axes.values())
    assert errors(request) == {'x': 'Canceled', 'y': 'SwitchUnknown', 'z': 'Canceled'}
    for name in 'xz':
        assert request.outcomes[name].message == (
            f'axis {name}: not started: axis y was not homed (SwitchUnknown)'
        )


def test_a_refusal_of_a_later_group(axes):
    request = Request([['x'], ['y'], ['z']], axes, 'owner', ready)
    request.start(0.0)
    axes['y'].refused = Outcome(Error.FeedbackStale, 'axis y: …')
    axes['x'].end()
    assert request.update(0.1)
    assert errors(request) == {'x': 'NoError', 'y': 'FeedbackStale', 'z': 'Canceled'}


def test_what_only_the_node_knows_is_asked_as_each_group_starts(axes):
    unready = {}
    request = Request([['x'], ['y', 'z']], axes, 'owner', unready.get)
    request.start(0.0)
    unready['z'] = Outcome(Error.PublisherConflict, 'axis z: …')
    axes['x'].end()
    assert request.update(0.1)
    assert not running(axes)
    assert errors(request) == {'x': 'NoError', 'y': 'Canceled', 'z': 'PublisherConflict'}


def test_cancel(axes):
    request = Request([['x', 'y'], ['z']], axes, 'owner', ready)
    request.start(0.0)
    request.cancel(request.names)
    assert (axes['x'].canceled, axes['y'].canceled, axes['z'].canceled) == (1, 1, 0)
    axes['x'].end(Error.Canceled)
    axes['y'].end()  # it was just about to be homed
    assert request.update(0.1)
    assert errors(request) == {'x': 'Canceled', 'y': 'NoError', 'z': 'Canceled'}
    assert request.outcomes['z'].message == 'axis z: not started: canceled'


def test_to_cancel_one_that_waits_stops_its_group_and_later_ones(axes):
    request = Request([['x'], ['y', 'z'], ['w']], {**axes, 'w': FakeAxis('w')}, 'owner', ready)
    request.start(0.0)
    assert [name for name in 'xyzw' if request.waits(name)] == ['y', 'z', 'w']
    request.cancel(['z'])
    assert not any(axis.canceled for axis in axes.values())
    axes['x'].end()
    assert request.update(0.1)
    assert not running(axes)
    assert not any(request.waits(name) for name in 'xyzw')
    assert {name: outcome.message for name, outcome in request.outcomes.items()} == {
        'x': 'axis x: …',
        'z': 'axis z: not started: canceled',
        'y': 'axis y: not started: axis z was not homed (Canceled)',
        'w': 'axis w: not started: axis z was not homed (Canceled)',
    }


@pytest.mark.parametrize('error', [Error.SwitchUnknown, Error.FeedbackStale, Error.NoController])
def test_what_is_missing_is_waited_for(axes, error):
    missing = {'z': Outcome(error, 'axis z: not there yet')}
    request = Request([['z']], axes, 'owner', missing.get, ready_timeout=5.0)
    request.start(0.0)
    assert request.pending
    assert not request.update(4.9)
    del missing['z']
    assert not request.update(4.95)
    assert running(axes) == 'z'
    assert not request.pending


def test_what_stays_missing_is_named_after_the_timeout(axes):
    missing = {'z': Outcome(Error.NoController, 'nobody subscribes')}
    request = Request([['z'], ['x']], axes, 'owner', missing.get, ready_timeout=5.0)
    request.start(1.0)
    assert not request.update(5.9)
    assert request.update(6.0)
    assert errors(request) == {'z': 'NoController', 'x': 'Canceled'}
    assert request.outcomes['z'].message == 'nobody subscribes, after waiting for 5 s'


def test_what_is_wrong_is_refused_at_once(axes):
    wrong = {'z': Outcome(Error.NoController, 'another order', final=True)}
    request = Request([['z']], axes, 'owner', wrong.get, ready_timeout=5.0)
    request.start(1.0)
    assert request.done
    assert errors(request) == {'z': 'NoController'}


def test_a_request_that_waits_is_canceled(axes):
    missing = {'z': Outcome(Error.SwitchUnknown, 'axis z: not there yet')}
    request = Request([['z']], axes, 'owner', missing.get, ready_timeout=5.0)
    request.start(1.0)
    request.cancel(['z'])
    assert request.update(1.1)
    assert errors(request) == {'z': 'Canceled'}


def test_all_that_is_missing_is_named_together():
    switch = Outcome(Error.SwitchUnknown, 'axis x: no message yet')
    nobody = Outcome(Error.NoController, 'nobody subscribes')
    both = together([switch, nobody, nobody])
    assert both.error is Error.SwitchUnknown
    assert both.message == 'axis x: no message yet; NoController: nobody subscribes'


def test_abandon(axes):
    request = Request([['x', 'y'], ['z']], axes, 'owner', ready)
    request.start(0.0)
    axes['x'].end()
    request.update(0.1)
    request.cancel(request.names)
    request.abandon('because')
    assert request.done
    assert errors(request) == {'x': 'NoError', 'y': 'Canceled', 'z': 'Canceled'}
    assert request.outcomes['y'].message == 'axis y: because'


# -- waiting until the axes are ready -----------------------------------------------------------


def moving(name):
    return Outcome(Error.AxisMoving, f'axis {name}: the axis moves at 0.1 m/s')


def test_a_request_waits_until_the_axis_rests(axes):
    axes['z'].refused = moving('z')
    request = Request([['z'], ['x']], axes, 'owner', ready)
    request.start(1.0)
    assert request.pending
    assert not request.done
    assert not request.update(1.5)
    assert running(axes) == ''
    axes['z'].refused = None
    assert not request.update(1.9)
    assert running(axes) == 'z'
    assert not request.pending


def test_an_axis_that_does_not_come_to_rest_is_refused(axes):
    axes['z'].refused = moving('z')
    request = Request([['z'], ['x']], axes, 'owner', ready)
    request.start(1.0)
    assert not request.update(1.999)
    assert request.update(2.0)
    assert errors(request) == {'z': 'AxisMoving', 'x': 'Canceled'}
    assert request.outcomes['z'].message.endswith('0.1 m/s, after waiting for 1 s')


def test_what_is_wrong_is_refused_at_once_though_another_axis_moves(axes):
    axes['x'].refused = moving('x')
    axes['y'].refused = Outcome(Error.ServoOff, 'off')
    request = Request([['x', 'y']], axes, 'owner', ready)
    request.start(1.0)
    assert request.done
    assert not request.pending


def test_a_request_that_waits_can_be_canceled(axes):
    axes['z'].refused = moving('z')
    request = Request([['z']], axes, 'owner', ready)
    request.start(1.0)
    request.cancel(['z'])
    assert request.update(1.1)
    assert errors(request) == {'z': 'Canceled'}


@pytest.mark.parametrize('error', [Error.SwitchUnknown, Error.FeedbackStale])
def test_missing_inputs_are_waited_for(axes, error):
    missing = {'z': Outcome(error, 'axis z: no message yet')}
    request = Request([['z']], axes, 'owner', missing.get, ready_timeout=5.0)
    request.start(0.0)
    assert not request.update(4.9)
    del missing['z']
    assert not request.update(4.95)
    assert running(axes) == 'z'
    impatient = Request([['x']], axes, 'owner', lambda _: Outcome(error, ''))
    impatient.start(0.0)
    assert impatient.done
