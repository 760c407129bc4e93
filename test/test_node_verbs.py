# SPDX-License-Identifier: Apache-2.0
"""The verbs of `homing` that talk to a running node, in a namespace."""

import io
import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading

import pytest
import ros_harness as ros
from homing_interfaces.msg import AxisState

from homing_node.cli import live, main
from homing_node.client import HomingClient
from homing_node.plant import layout_file

NODE = '/cell/homing_node'
COMMAND = 'import sys; from homing_node.cli import main; sys.exit(main())'
REMAPPED = ['-r', '__ns:=/cell']


#: An axis with three limit switches at each end.
LIMITS = [f'{end}_limit_switch' for end in ('positive', 'negative')]
ALL_LIMITS = {
    'home_type': 'NearLS',
    'near_ls_type': 'Dec',
    'external_ls_type': 'Dec',
    'switches': [kind + limit for kind in ('', 'near_', 'external_') for limit in LIMITS],
}
ALL_FLAGS = {
    'near_positive_limit_switch': [0.066, 0.135],
    'near_negative_limit_switch': [-0.055, 0.014],
    'external_positive_limit_switch': [0.073, 0.135],
    'external_negative_limit_switch': [-0.055, 0.007],
}
#: An axis with nothing but its hard stops.
END = {
    'home_type': 'MechanicalEndDetection',
    'mechanical_end_detection_pos_diff': 0.002,
    'switches': [],
    'following_error': 0.01,
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    axes = {'x': {}, 'y': {'pause_mode': True}, 'n': ALL_LIMITS, 'm': END}
    with ros.World(
        tmp_path_factory.mktemp('verbs'),
        ros.node_parameters(axes),
        ros.plant_parameters({'x': {}, 'y': {}, 'n': ALL_FLAGS, 'm': {}}),
        NODE,
        REMAPPED,
        REMAPPED,
    ) as world:
        world.client.home('x')  # the plant is heard
        yield world


@pytest.fixture
def homing(world, monkeypatch, capsys):
    """Return what runs a verb against the node: its status, and what it said."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(world.domain.number))
    # On a busy machine an action is discovered later than the node that has it.
    monkeypatch.setattr(live, 'PATIENCE', ros.PATIENCE)

    def run(*arguments, node=NODE):
        status = main([*arguments, '--node', node])
        out, err = capsys.readouterr()
        return status, out, err

    yield run
    world.client.rest()


class OnTerminal:
    """The command as a process of its own on a terminal of some columns."""

    def __init__(self, world, *arguments, columns=40, **environment):
        lead, follow = pty.openpty()
        variables = {
            'TERM': 'xterm-256color',
            'COLUMNS': str(columns),
            'ROS_DOMAIN_ID': str(world.domain.number),
        }
        self.process = subprocess.Popen(
            [sys.executable, '-c', COMMAND, *arguments, '--node', NODE],
            stdout=follow,
            stderr=follow,
            env={**os.environ, **variables, **environment},
        )
        os.close(follow)
        self._parts = []
        self._reader = threading.Thread(target=self._read, args=(lead,))
        self._reader.start()

    def _read(self, lead):
        while True:
            try:
                part = os.read(lead, 65536)
            except OSError:
                break
            if not part:
                break
            self._parts.append(part)
        os.close(lead)

    @property
    def written(self):
        return b''.join(self._parts).decode()

    def wait(self):
        status = self.process.wait(ros.PATIENCE)
        self._reader.join()
        return status


def paused(world, axis):
    """Wait until an axis is paused; return its states, which are recorded on."""
    states = world.client.record_states(axis)
    world.client.until(lambda: states and states[-1].message.paused, what=f'{axis} to pause')
    return states


def test_home_and_verify_without_a_terminal(homing):
    status, out, err = homing('home', 'x')
    assert (status, err) == (0, '')
    lines = out.splitlines()
    assert 'x: SecondHSSearch' in lines and 'x: homed' in lines and lines[-1].startswith('Homed: ')
    assert '\x1b' not in out
    status, out, _ = homing('verify', 'x')
    assert status == 0 and 'Verified: ' in out
    status, out, err = homing('cancel', 'x')
    assert (status, out, err) == (0, 'x: nothing to cancel\n', '')


def test_a_refused_request(homing):
    status, out, err = homing('home', 'u')
    assert status == 1 and err.startswith("homing: UnknownAxis: 'u' is none of")
    status, out, err = homing('verify', 'y', '--json')
    told = json.loads(out)
    assert status == 1 and (told['ok'], told['error']) == (False, 'NotHomed')


@pytest.mark.long
def test_continue_lets_a_paused_axis_go_on(world, homing):
    child = OnTerminal(world, 'home', 'y', columns=100)
    paused(world, 'y')
    assert homing('continue') == (0, 'y: it goes on\n', '')

    def over():
        world.client.trigger('y/continue')
        return child.process.poll() is not None

    world.client.until(over, what='y to be homed')
    assert child.wait() == 0
    assert 'paused' in child.written and 'Homed: ' in child.written


def test_ctrl_c_cancels_and_waits_for_rest(world, homing):
    child = OnTerminal(world, 'home', 'y', NO_COLOR='1')
    states = paused(world, 'y')
    before = len(states)
    assert homing('continue', 'y') == (0, 'y: it goes on\n', '')
    world.client.until(  # it may have paused again meanwhile
        lambda: any(not one.message.paused for one in states[before:]), what='y to go on'
    )
    child.process.send_signal(signal.SIGINT)
    assert child.wait() == 130
    text = ' '.join(child.written.split())
    assert 'interrupted; the axes are at rest: Canceled: axis y' in text
    assert 'Traceback' not in text
    assert '\x1b[3' not in text  # no colour
    world.client.until(lambda: states[-1].message.state == 'Idle', what='rest')
    assert states[-1].message.error == 'Canceled'


def test_jog(world, homing):
    """The action, beside a home that stays; ended by a limit, and refused."""
    with HomingClient(NODE) as user:
        assert user.home('x')
        before = user.state('x')
        feedback = []
        away = user.jog('x', -0.02, 0.04, lambda: True, feedback.append)
        assert away.success, away.message
        assert away.message.startswith('Jogged: -20 mm, 1 edge met')
        (edge,) = away.edges
        assert (edge.input, edge.level) == ('home_switch', False)
        assert edge.position == pytest.approx(0.05495, abs=2 * edge.uncertainty)
        assert -0.045 < edge.velocity < 0.0
        now = world.client.node.get_clock().now().nanoseconds * 1e-9
        assert 0.0 < now - edge.stamp.sec - edge.stamp.nanosec * 1e-9 < 10.0
        assert {one.state.state for one in feedback} >= {'Jogging'}
        assert -0.021 < min(one.distance_to_go for one in feedback) < -0.005
        state = away.state
        assert state.homed and state.home_offset == before.home_offset
        assert state.position == pytest.approx(before.position - 0.02, abs=2e-4)
        fast = user.jog('x', 0.01, 0.2)
        assert fast.error_code == AxisState.INVALID_PARAMETER
        assert '0.2 m/s must be <= homing_velocity_fast, 0.05 m/s' in fast.message
        assert user.jog('u', 0.01, 0.02).error_code == AxisState.UNKNOWN_AXIS
        limit = user.jog('x', 0.08, 0.05)
        assert limit.error_code == AxisState.LS_TRIGGERED
        assert [one.input for one in limit.edges][-1] == 'positive_limit_switch'


@pytest.mark.long
def test_a_jog_ends_with_its_deadman(world, homing):
    """Where it is released, and where it never comes."""
    with HomingClient(NODE) as user:
        assert user.home('x')
        feedback = []

        def until_it_moves():
            return not any(abs(one.distance_to_go) < 0.015 for one in feedback)

        released = user.jog('x', -0.02, 0.02, until_it_moves, feedback.append)
        assert released.error_code == AxisState.CANCELED and 'deadman' in released.message
        never = user.jog('x', -0.01, 0.02, lambda: False)
        assert never.error_code == AxisState.CANCELED and 'no true on /cell/' in never.message
        assert not user.state('x').paused and user.state('x').homed


def stated(text, key):
    """Return how far a place of a layout file may be off, by its comment, m."""
    number, unit = re.search(rf'^  {key}\w+: .*# ± ([\d.]+) (\w+)$', text, re.MULTILINE).groups()
    return float(number) * {'m': 1.0, 'mm': 1e-3, 'µm': 1e-6}[unit]


@pytest.mark.long
def test_survey(world, homing, tmp_path, monkeypatch):
    """The layout that is written is the plant's, within what the file says."""
    world.client.home('x')
    path = tmp_path / 'machine.yaml'
    wanted = ['survey', 'x', '--within', '0.03', '--velocity', '0.05', '-o', str(path)]
    status, out, err = homing(*wanted, '--yes')
    assert (status, err) == (0, ''), (out, err)
    found = layout_file.load(path).layouts['x']
    told = path.read_text()
    home, limit = found.switches['home_switch'], found.switches['positive_limit_switch']
    assert (home.on_from, home.on_to) == pytest.approx((0.055, 0.061), abs=3e-4), told
    assert limit.on_from == pytest.approx(0.08, abs=3e-4) and limit.on_to == float('inf')
    assert 0.005 < found.lag < 0.03, told  # that of the drive, and what messages and cycles take
    assert 'negative_limit_switch: it stayed off' in told
    status, _, err = homing(*wanted, '--yes')
    assert status == 2 and 'is there already' in err
    path.unlink()
    monkeypatch.setattr('sys.stdin', io.StringIO())
    status, _, err = homing(*wanted)
    assert status == 2 and 'give --yes' in err


@pytest.mark.long
def test_survey_of_near_limits_and_of_hard_stops(homing, tmp_path):
    """The limits that the axis meets first are found; at a hard stop it says what stands there."""
    path = tmp_path / 'n.yaml'
    wanted = '--within', '0.07', '--velocity', '0.05', '--yes'
    status, out, err = homing('survey', 'n', *wanted, '-o', str(path))
    assert (status, err) == (0, ''), (out, err)
    found, text = layout_file.load(path).layouts['n'], path.read_text()
    upper, half = found.switches['near_positive_limit_switch'].on_from, stated(text, 'near_posi')
    assert upper == pytest.approx(0.066, abs=half), text
    lower, half = found.switches['near_negative_limit_switch'].on_to, stated(text, 'near_nega')
    assert lower == pytest.approx(0.014, abs=half), text
    assert set(found.stays_off) == set(ALL_LIMITS['switches']) - set(found.switches)
    path = tmp_path / 'm.yaml'
    status, out, err = homing('survey', 'm', *wanted, '-o', str(path))
    assert status == 1 and err.startswith('homing: FollowingError: axis m: '), (out, err)
    assert 'if it stands at a hard stop, write the stop into the file' in out
    assert path.exists()


@pytest.mark.long
def test_ctrl_c_ends_a_survey_with_what_was_seen(world, tmp_path):
    world.client.home('x')
    path = tmp_path / 'x.yaml'
    arguments = '--within', '0.03', '--velocity', '0.02', '--yes', '-o', str(path)
    child = OnTerminal(world, 'survey', 'x', *arguments, columns=100)
    states = world.client.record_states('x')
    # Back from the upper limit, over the home switch: the first motion has ended, the second not.
    world.client.until(
        lambda: (
            states
            and states[-1].message.state == 'Jogging'
            and states[-1].message.position < -0.01
        ),
        what='the way back',
    )
    child.process.send_signal(signal.SIGINT)
    assert child.wait() == 130
    text = ' '.join(child.written.split())
    assert 'interrupted; the axes are at rest: Canceled: axis x' in text, text
    assert 'Traceback' not in text
    found = layout_file.load(path).layouts['x']
    assert found.switches['positive_limit_switch'].on_from == pytest.approx(0.08, abs=2e-3)
    assert 'the survey ended there, Canceled' in path.read_text()
    world.client.until(lambda: states[-1].message.state == 'Idle', what='rest')


@pytest.mark.long
def test_watch(world, homing, monkeypatch):
    status, out, _ = homing('watch', '--once', '--json')
    told = json.loads(out)
    assert status == 0 and set(told['axes']) == {'x', 'y', 'n', 'm'}
    home = told['axes']['x']['inputs']['home_switch']
    assert home['source'] == f'{NODE}/x/home_switch' and home['rate'] == 'on change'
    piped = subprocess.Popen(
        [sys.executable, '-c', COMMAND, 'watch', 'x', '--node', NODE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    first = [piped.stdout.readline()]
    world.client.home('x')
    while not first[-1].endswith(' s  x: homed\n'):
        first.append(piped.stdout.readline())
    piped.send_signal(signal.SIGINT)
    _, err = piped.communicate(timeout=ros.PATIENCE)
    assert (piped.returncode, err) == (130, 'homing: interrupted\n')
    assert any(' s  x: SecondHSSearch' in line for line in first)


def test_there_is_no_such_node(world, homing, monkeypatch):
    with HomingClient(NODE) as user:
        assert user.wait_for_node() and user.others() == [NODE]
    assert live.absent('/homing_node', [NODE], 'home') == [
        'there is no homing node /homing_node',
        f'there is {NODE}: homing home --node {NODE}',
    ]
    monkeypatch.setattr(live, 'PATIENCE', 0.2)
    status, out, err = homing('home', 'x', node='/homing_node')
    assert (status, out) == (2, '')
    assert err.startswith('homing: there is no homing node /homing_node\nhoming: there is ')
