# SPDX-License-Identifier: Apache-2.0
"""Who homes what, and who gets which answer."""

import pytest
from test_request import FakeAxis, running

from homing_node.core.dispatch import Dispatch
from homing_node.core.outcome import Outcome
from homing_node.procedures.states import Error


@pytest.fixture
def axes():
    return {name: FakeAxis(name) for name in 'xyz'}


@pytest.fixture
def dispatch(axes):
    return dispatch_of(axes, (('z',), ('x', 'y')))


def dispatch_of(axes, groups, unready=lambda name: None):
    return Dispatch(axes, groups, unready, object)


def test_all_axes_home_in_the_order_of_the_groups(dispatch, axes):
    request = dispatch.home(['x', 'y', 'z'], 'me', 0.0)
    waiter = dispatch.waiter(request)
    assert request.groups == [('z',), ('x', 'y')]
    assert running(axes) == 'z'
    axes['z'].end()
    assert not dispatch.update(0.1)
    axes['x'].end()
    axes['y'].end()
    assert dispatch.update(0.2) == [waiter]
    assert dispatch.idle
    assert not dispatch.update(0.3)


def test_some_axes_home_in_that_order_and_unlisted_ones_afterwards(axes):
    dispatch = dispatch_of(axes, (('z', 'y'),))
    assert dispatch.home(['x', 'y'], 'me', 0.0).groups == [('y',), ('x',)]


def test_busy(dispatch, axes):
    dispatch.home(['x', 'z'], '~/first', 0.0)
    for names in (['z'], ['x'], ['x', 'y', 'z']):
        refusal = dispatch.home(names, '~/second', 0.1)
        assert isinstance(refusal, Outcome)
        assert refusal.error is Error.Busy
        # In the order of the sequence: z runs, x waits for it.
        assert refusal.message.startswith(f'axis {names[0]}: ~/first is homing z, x (')
    assert running(axes) == 'z'
    assert axes['y'].runs == 0
    other = dispatch.home(['y'], '~/other', 0.2)
    assert running(axes) == 'yz'
    axes['y'].end()
    assert dispatch.update(0.3)
    assert other.success
    assert not dispatch.idle


def test_an_axis_may_home_again_as_soon_as_the_answer_is_given(dispatch, axes):
    dispatch.home(['x'], 'me', 0.0)
    axes['x'].end()
    dispatch.update(0.1)
    assert dispatch.home(['x'], 'me', 0.2).names == ('x',)


def test_an_axis_that_is_not_ready_is_not_started(axes):
    dispatch = dispatch_of(
        axes, (), lambda name: Outcome(Error.PublisherConflict, 'two') if name == 'y' else None
    )
    assert dispatch.home(['x', 'y'], 'me', 0.0).error is Error.PublisherConflict
    assert not running(axes)
    assert dispatch.idle


def test_an_axis_that_is_unknown(dispatch, axes):
    refusal = dispatch.home(['x', 'q'], 'me', 0.0)
    assert refusal.error is Error.UnknownAxis
    assert refusal.message == "'q' is none of the axes x, y, z"
    assert not running(axes)


@pytest.mark.parametrize('name', ['x2', 'x.x2'])
def test_a_follower_is_no_axis(dispatch, axes, name):
    axes['x'].drives['x.x2'] = None
    refusal = dispatch.home([name], 'me', 0.0)
    assert refusal.error is Error.UnknownAxis
    assert refusal.message == f'{name!r} is a follower of the gantry x: home x'


def test_a_refused_axis_answers_at_once(dispatch, axes):
    axes['x'].refused = Outcome(Error.FeedbackStale, 'axis x: …')
    request = dispatch.home(['x'], 'me', 0.0)
    assert dispatch.waiter(request) is None
    assert dispatch.idle
    assert request.outcomes['x'].error is Error.FeedbackStale


def test_cancel_answers_at_rest(dispatch, axes):
    home = dispatch.waiter(dispatch.home(['x'], 'me', 0.0))
    moving, waiting, cancel = dispatch.cancel(['x', 'y'])
    assert (moving, waiting) == (['x'], [])
    assert axes['x'].canceled
    assert not dispatch.update(0.1)
    axes['x'].end(Error.Canceled)
    assert dispatch.update(0.2) == [home, cancel]
    assert dispatch.idle


def test_nothing_to_cancel_answers_at_once(dispatch):
    assert dispatch.cancel(['x', 'y', 'z']) == ([], [], None)
    assert dispatch.idle


def test_to_cancel_one_axis_stops_its_group(dispatch, axes):
    request = dispatch.home(['x', 'y', 'z'], 'me', 0.0)
    axes['z'].end()
    dispatch.update(0.1)
    assert running(axes) == 'xy'
    dispatch.cancel(['x'])
    assert not axes['y'].canceled
    axes['x'].end(Error.Canceled)
    dispatch.update(0.2)
    assert axes['y'].canceled
    axes['y'].end(Error.Canceled)
    assert dispatch.update(0.3)
    assert not request.success


def test_to_cancel_all_leaves_nothing_to_start(dispatch, axes):
    request = dispatch.home(['x', 'y', 'z'], 'me', 0.0)
    dispatch.cancel(['x', 'y', 'z'])
    axes['z'].end()  # it was homed at the same moment
    assert dispatch.update(0.1)
    assert not running(axes)
    assert not request.success


def test_to_cancel_an_axis_that_waits(dispatch, axes):
    """It never moves, though it rests already."""
    request = dispatch.home(['x', 'y', 'z'], 'me', 0.0)
    assert dispatch.cancel(['x']) == ([], ['x'], None)
    axes['z'].end()
    assert dispatch.update(0.2)
    assert not running(axes)
    assert request.outcomes['z'].success
    assert request.outcomes['x'] == Outcome(Error.Canceled, 'axis x: not started: canceled')


def test_close(dispatch, axes):
    home = dispatch.waiter(dispatch.home(['x', 'y', 'z'], 'me', 0.0))
    dispatch.close()
    assert axes['z'].canceled
    refusal = dispatch.home(['x'], 'me', 0.1)
    assert refusal.error is Error.Canceled
    assert 'shutting down' in refusal.message
    axes['z'].end(Error.Canceled)
    assert dispatch.update(0.2) == [home]
    assert dispatch.idle
    assert axes['x'].runs == 0


def test_abandon(dispatch, axes):
    request = dispatch.home(['z'], 'me', 0.0)
    home, (_, _, cancel) = dispatch.waiter(request), dispatch.cancel(['z'])
    assert dispatch.abandon('because') == [home, cancel]
    assert dispatch.idle
    assert dispatch.closed
    assert request.outcomes['z'] == Outcome(Error.Canceled, 'axis z: because')


def test_a_dry_run_says_the_order_and_what_would_refuse_and_moves_nothing(axes):
    missing = Outcome(Error.NoController, 'nobody plays the setpoints')
    dispatch = dispatch_of(axes, (('z',), ('x', 'y')), {'y': missing}.get)
    axes['x'].refused = Outcome(Error.EmergencyStop, 'the emergency stop is on')
    found = dispatch.preview(['x', 'y', 'z', 'q'], 0.0)
    assert found.groups == [('z',), ('x', 'y')]
    assert [(name, one.error) for name, one in found.missing] == [
        ('x', 'EmergencyStop'),
        ('y', 'NoController'),
        ('q', 'UnknownAxis'),
    ]
    assert dispatch.preview(['z'], 0.0).missing == []
    assert not any(axis.runs for axis in axes.values())
    dispatch.home(['z'], 'me', 0.0)
    assert dispatch.preview(['z'], 0.1).missing[0][1].error is Error.Busy
    dispatch.close()
    assert dispatch.preview(['x'], 0.2).missing[0] == (
        '',
        Outcome(Error.Canceled, 'the node is shutting down'),
    )
