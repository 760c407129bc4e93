# SPDX-License-Identifier: Apache-2.0
"""What the client of a script makes of answers, and of none."""

import io
import json
import math
from types import SimpleNamespace

import pytest
from homing_interfaces.msg import AxisState
from rclpy.task import Future
from rich.console import Console

from homing_node.cli import main
from homing_node.cli.progress import Display
from homing_node.client import Abandoned, Answer, HomingClient, Interrupted, NotThere
from homing_node.ros.calls import Calls


@pytest.mark.parametrize(
    ('timeout', 'alive', 'text'),
    [(None, False, 'has ended, or is out of reach'), (0.1, True, 'did not answer within 0.1 s')],
    ids=['gone', 'silent'],
)
def test_no_answer_comes(timeout, alive, text):
    with pytest.raises(TimeoutError, match=f'/homing_node {text}'):
        calls_of(None).wait(Future(), timeout, lambda: alive)


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


class Server:
    """What an ActionClient offers, of a server that accepts a goal and then says nothing."""

    def __init__(self, answers_cancel=True):
        self.answers_cancel, self.canceled = answers_cancel, False
        self.result = Future()

    def wait_for_server(self, timeout):
        return True

    def server_is_ready(self):
        return True

    def send_goal_async(self, goal, feedback):
        return done(
            SimpleNamespace(
                accepted=True, get_result_async=lambda: self.result, cancel_goal_async=self._cancel
            )
        )

    def _cancel(self):
        self.canceled = True
        if self.answers_cancel:
            self.result.set_result(SimpleNamespace(result='canceled'))
        return done(None)


def done(value):
    future = Future()
    future.set_result(value)
    return future


class Thread:
    """An executor whose thread does at once what it is given."""

    def __init__(self):
        self.sent = 0

    def create_task(self, send):
        self.sent += 1
        return done(send())


def calls_of(server):
    """Return calls without a graph, whose one server this is."""
    calls = Calls.__new__(Calls)
    calls._asked, calls._discovery = '/homing_node', 0.1
    calls._clients, calls._executor = {'home (action)': server}, Thread()
    return calls


def test_only_the_thread_that_takes_the_answers_sends_goals():
    """Another one may be told of an answer before rclpy's client knows the request."""
    server = Server()
    server.result.set_result(SimpleNamespace(result='homed'))
    calls = calls_of(server)
    assert calls.act(None, 'home', None) == 'homed'
    assert calls._executor.sent == 2  # the goal, and the request of its result


def test_a_node_that_falls_silent_is_told_to_stop(monkeypatch):
    monkeypatch.setattr('homing_node.ros.calls.SILENCE', 0.05)
    monkeypatch.setattr('homing_node.ros.calls.ALIVE_PERIOD', 0.02)
    server = Server()
    with pytest.raises(TimeoutError, match='/homing_node has ended, or is out of reach'):
        calls_of(server).act(None, 'home', None)
    assert server.canceled


def test_ctrl_c_waits_for_the_end_of_the_goal(monkeypatch):
    server = Server()
    calls = calls_of(server)
    waits = calls.wait

    def wait(future, *bounds):
        if future is server.result and not server.canceled:
            raise KeyboardInterrupt
        return waits(future, *bounds)

    monkeypatch.setattr(calls, 'wait', wait)
    with pytest.raises(Interrupted) as ended:
        calls.act(None, 'home', None)
    assert ended.value.result == 'canceled'


@pytest.mark.parametrize('verb', ['home', 'verify', 'cancel', 'continue', 'repeat'])
@pytest.mark.parametrize(
    ('error', 'status', 'said'),
    [
        (NotThere('no service'), 1, 'homing: no service\n'),
        (TimeoutError('it is gone'), 1, 'it is gone; it is not known whether an axis still moves'),
        (Interrupted(SimpleNamespace(message='Canceled')), 130, 'the axes are at rest: Canceled'),
        (KeyboardInterrupt(), 130, 'interrupted'),
        (Abandoned(), 130, 'interrupted twice; canceled, but it is not known whether an axis'),
    ],
    ids=['not there', 'gone', 'interrupted', 'interrupted at once', 'interrupted twice'],
)
def test_how_a_verb_ends(monkeypatch, capsys, verb, error, status, said):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(HomingClient, 'wait_for_node', lambda self: True)
    monkeypatch.setattr(HomingClient, 'parameters', lambda *_: {'axes': ['x']})
    for name in ('home', 'verify', 'cancel_each', 'resume'):
        monkeypatch.setattr(HomingClient, name, fails)
    assert main([verb, 'x']) == status
    assert said in capsys.readouterr().err


def test_a_feedback_that_raises_leaves_the_call_at_its_end():
    """The thread of the client goes on, and the result is waited for."""
    server = Server()

    def send(goal, feedback):
        for _ in range(2):
            feedback(SimpleNamespace(feedback='one'))
        server.result.set_result(SimpleNamespace(result='homed'))
        return Server.send_goal_async(server, goal, feedback)

    server.send_goal_async = send
    told = []

    def broken(feedback):
        told.append(feedback)
        raise RuntimeError('it broke')

    with pytest.raises(RuntimeError, match='it broke'):
        calls_of(server).act(None, 'home', None, broken)
    assert told == ['one'] and not server.canceled


def test_a_second_ctrl_c_does_not_wait(monkeypatch, capsys):
    server = Server(answers_cancel=False)
    calls = calls_of(server)
    waits = calls.wait

    def wait(future, *bounds):
        if future is server.result:
            raise KeyboardInterrupt
        return waits(future, *bounds)

    monkeypatch.setattr(calls, 'wait', wait)
    with pytest.raises(Abandoned):
        calls.act(None, 'home', None)
    assert server.canceled


def test_who_reads_a_pipe_may_go(monkeypatch):
    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    monkeypatch.setattr('sys.stdout', Gone())
    with Display(Console(file=io.StringIO())) as display:
        display.show('x', 'HSSearch', 0.1, 1.0, '')
        display.show('x', 'homed', 1.0, 1.0, '')


@pytest.mark.parametrize('verb', ['verify', 'continue'])
def test_a_coordinator_only_homes_and_cancels(monkeypatch, capsys, verb):
    cells = {'nodes': ['/cell1/homing_node']}
    monkeypatch.setattr(HomingClient, 'wait_for_node', lambda self: True)
    monkeypatch.setattr(
        HomingClient, 'parameters', lambda _, name: {n: cells[n] for n in cells if n == name}
    )
    assert main([verb, 'cell1/x', '--node', 'line']) == 2
    assert capsys.readouterr().err == (
        'homing: /line is a coordinator, which homes and cancels only; ask the node of a cell: '
        f'homing {verb} --node /cell1/homing_node\n'
    )


DRY_RUNS = {
    'all is well': (
        Answer(True, 'dry run: nothing is missing', (), ('z', 'x, y'), (1.25, 2.0)),
        0,
        'step 1: z: about 1.2 s\nstep 2: x, y: about 2.0 s\nin all: about 3.2 s\n'
        'nothing is missing\n',
        '',
    ),
    'nothing is known': (
        Answer(True, 'dry run: nothing is missing; z: why', (), ('z',), (math.nan,)),
        0,
        'step 1: z: how long is not known\nnothing is missing; z: why\n',
        '',
    ),
    'all are homed': (
        Answer(True, 'dry run: nothing is missing'),
        0,
        'there is nothing to home: every axis is homed (--force homes them, too)\n'
        'nothing is missing\n',
        '',
    ),
    'something is missing': (
        Answer(False, 'ServoOff: it is off', (), ('z',), (1.0,), ('z: ServoOff: it is off',)),
        1,
        'step 1: z: about 1.0 s\n',
        'homing: missing: z: ServoOff: it is off\n',
    ),
    'refused': (Answer(False, 'Busy: x homes'), 1, '', 'homing: missing: Busy: x homes\n'),
}


@pytest.mark.parametrize('case', DRY_RUNS)
def test_a_dry_run_tells_the_order_the_times_and_what_is_missing(monkeypatch, capsys, case):
    answer, status, out, err = DRY_RUNS[case]
    asked = []
    monkeypatch.setattr(HomingClient, 'wait_for_node', lambda self: True)
    monkeypatch.setattr(
        HomingClient, 'home', lambda _, *axes, **given: asked.append((axes, given)) or answer
    )
    assert main(['home', 'z', '--dry-run']) == status
    assert capsys.readouterr() == (out, err)
    assert asked == [(('z',), {'dry_run': True, 'force': False})]
    assert main(['home', '--dry-run', '--force', '--json']) == status
    told = json.loads(capsys.readouterr().out)
    assert told['steps'] == list(answer.steps) and told['ok'] == answer.success
    assert told.get('durations', []) == [
        None if math.isnan(one) else one for one in answer.durations
    ]
    assert asked[-1] == ((), {'dry_run': True, 'force': True})


class Cancel:
    """A client of a cancel service that is there, or not; the answer comes once all are asked."""

    def __init__(self, asked, there=True):
        self.asked, self.there = asked, there

    def service_is_ready(self):
        return self.there

    def call_async(self, _):
        future = Future()
        self.asked.append(future)
        if len(self.asked) == 2:
            for one in self.asked:
                one.set_result(SimpleNamespace(success=True, message='at rest'))
        return future


def test_several_axes_are_canceled_at_the_same_time():
    """None waits for the rest of another, nor for a name that is none."""
    asked = []
    client = HomingClient.__new__(HomingClient)
    client.node_name, client.discovery, client._calls = '/homing_node', 0.1, calls_of(None)
    client._calls._clients = {
        f'/homing_node/{axis}/cancel': Cancel(asked, axis != 'u') for axis in 'uxy'
    }
    answers = client.cancel_each('u', 'x', 'y')
    assert answers['x'] == answers['y'] == Answer(True, 'at rest')
    assert not answers['u'] and answers['u'].message.startswith('no service /homing_node/u/cancel')
