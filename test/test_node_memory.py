# SPDX-License-Identifier: Apache-2.0
"""The memory between processes: restarts of the node, its files, verify and accept_home."""

import pytest
import ros_harness as ros
from diagnostic_msgs.msg import DiagnosticArray

from homing_node.memory.store import read


def restart(one, parameters, plant=False):
    """End the node, and with it the plant or not, and start them again."""
    one.client.watch()
    one.node.signal()
    assert one.node.wait() == 0
    one.processes.remove(one.node)
    if plant:
        one.plant.signal()
        assert one.plant.wait() == 0
        one.processes.remove(one.plant)
        one.plant = one.run('simulated_axes', ros.plant_parameters({'x': {}}))
    one.node = one.run('homing_node', parameters)
    one.client.watch(*one.processes)


def state_where(one, condition, what):
    """Wait for a state of the axis."""
    states = one.client.record_states('x')
    found = one.client.until(
        lambda: next((s.message for s in reversed(states) if condition(s.message)), None),
        what=what,
    )
    one.client.forget(states)
    return found


def file_of(memory):
    return read((memory / 'x.jsonl').read_bytes())


@pytest.fixture(scope='module')
def kept(tmp_path_factory):
    """A world whose axis has homed, and the folder of its memory."""
    folder = tmp_path_factory.mktemp('memory')
    memory = folder / 'kept' / 'here'
    (folder / 'world').mkdir()
    parameters = ros.node_parameters(
        {'x': {'restore': 'verify', 'rehome': True, 'rehome_velocity': 0.2}}, memory=str(memory)
    )
    with ros.World(folder / 'world', parameters, ros.plant_parameters({'x': {}})) as one:
        one.parameters = parameters
        one.memory = memory
        one.answer = one.client.home('x')['x']
        assert one.answer.success, one.answer.message
        yield one


def test_a_run_is_in_the_file(kept):
    kept.client.until(lambda: (kept.memory / 'x.jsonl').exists() and file_of(kept.memory).runs)
    contents = file_of(kept.memory)
    (run,) = contents.runs
    assert contents.whole and run.error == 'NoError'
    told = kept.answer.message.partition('home_position_raw=')[2].split()[0]
    assert float(told) == pytest.approx(run.home, abs=1e-6)
    assert len(run.seen) >= 3 and '/simulated_axes' in run.frame


def test_the_home_is_restored_when_the_node_alone_was_restarted(kept):
    before = state_where(kept, lambda s: s.homed and s.state == 'Idle', 'the home')
    assert before.home_source == 'run'
    restart(kept, kept.parameters)
    diagnostics = kept.client.record(DiagnosticArray, '/diagnostics')
    after = state_where(kept, lambda s: s.homed, 'the restored home')
    assert after.home_source == 'restored'
    assert after.home_offset == before.home_offset
    assert after.position == pytest.approx(before.position, abs=1e-4)
    told = kept.client.until(
        lambda: next(
            (s for d in diagnostics for s in d.message.status if 'restored' in s.message), None
        ),
        what='a warning in the diagnostics',
    )
    kept.client.forget(diagnostics)
    assert told.level == b'\x01'
    assert 'home restored from before the restart' in kept.node.output


def test_the_first_request_verifies_it_and_the_second_one_homes_quickly(kept):
    first = kept.client.home('x')['x']
    assert first.success, first.message
    assert first.message.startswith('Verified: ') and ' ± ' in first.message, first.message
    assert state_where(kept, lambda s: s.homed, 'a home').home_source == 'verified'
    second = kept.client.home('x')['x']
    assert second.success and second.message.startswith('Homed: '), second.message
    kept.client.until(lambda: len(file_of(kept.memory).runs) == 3, what='the third run')
    assert [run.kind for run in file_of(kept.memory).runs] == ['home', 'verify', 'rehome']


def test_verify_and_accept_home_by_service(kept):
    answer = kept.client.trigger('x/verify')
    assert answer.success and answer.message.startswith('Verified: '), answer.message
    accepted = kept.client.trigger('x/accept_home')
    assert accepted.success, accepted.message
    assert accepted.message.startswith('accepted: home_position_raw=0.05')


def test_a_second_node_on_the_same_folder_is_refused(kept):
    other = ros.Process('homing_node', kept.folder, kept.domain, kept.parameters)
    assert other.wait() == 1
    assert f'memory: {kept.memory} is in use by /homing_node (process ' in other.output


def test_a_new_driver_restores_nothing_and_says_why(kept):
    restart(kept, kept.parameters, plant=True)
    state = state_where(kept, lambda s: 'not restored' in s.message, 'the refusal')
    assert not state.homed and state.home_source == 'none'
    assert 'home not restored: another encoder, driver or file: ' in state.message


@pytest.mark.long
def test_a_disk_that_cannot_be_written_fails_no_homing(kept):
    """A file stands where the folder should be: root may write on a read-only one."""
    blocked = kept.folder / 'blocked'
    blocked.write_text('')
    restart(kept, {**kept.parameters, 'memory': str(blocked / 'memory')})
    answer = kept.client.home('x')['x']
    assert answer.success, answer.message
    assert f'nothing can be kept of the runs: {blocked}' in kept.node.output
    assert blocked.read_text() == ''
