# SPDX-License-Identifier: Apache-2.0
"""What the client of a script makes of answers, and of none."""

from types import SimpleNamespace

import pytest
from homing_interfaces.msg import AxisState
from rclpy.task import Future

from homing_node.client import Answer, HomingClient


@pytest.mark.parametrize(
    ('timeout', 'alive', 'text'),
    [(None, False, 'has ended, or is out of reach'), (0.1, True, 'did not answer within 0.1 s')],
    ids=['gone', 'silent'],
)
def test_no_answer_comes(timeout, alive, text):
    client = SimpleNamespace(node_name='/homing_node')
    with pytest.raises(TimeoutError, match=f'/homing_node {text}'):
        HomingClient._wait(client, Future(), timeout, lambda: alive)


@pytest.mark.parametrize(
    ('success', 'message', 'error'),
    [
        (False, 'Busy: axis x: ~/home is homing x', 'Busy'),
        (True, 'Homed: home_position_raw=1', ''),
        (False, 'axis x is not paused', ''),
    ],
)
def test_the_error_of_an_answer(success, message, error):
    assert Answer(success, message).error == error


MOVED = AxisState(error='FeedbackStale')
RESTED = AxisState(error='NoError')


@pytest.mark.parametrize(
    ('message', 'states', 'state', 'unheard'),
    [
        ('SwitchUnknown: any text', (), None, True),
        ('FeedbackStale: any text', (RESTED,), None, True),
        ('FeedbackStale: any text', (), RESTED, True),
        ('FeedbackStale: it ended a run', (RESTED, MOVED), None, False),
        ('FeedbackStale: it ended a run', (), MOVED, False),
        ('FeedbackStale: which axis?', (), None, False),
        ('Timeout: nobody publishes', (RESTED,), None, False),
    ],
)
def test_only_a_request_that_moved_nothing_is_repeated(message, states, state, unheard):
    client = SimpleNamespace(state=lambda axis: state)
    answer = Answer(False, message, states)
    assert HomingClient._unheard(client, answer, 'x' if state else '') is unheard
