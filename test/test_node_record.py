# SPDX-License-Identifier: Apache-2.0
"""The records between processes: a run that homes, and a node that is killed in a run."""

import io
import os
import subprocess
import sys

import pytest
import ros_harness as ros
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from homing_node import cli
from homing_node.parameters import yaml_file
from homing_node.recording import reading
from homing_node.recording.folder import name_of


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    """A world whose node records, and the folder of its records."""
    folder = tmp_path_factory.mktemp('record')
    records = folder / 'records'
    (folder / 'world').mkdir()
    axes = {'x': {'homing_velocity_fast': 0.04}}
    parameters = ros.node_parameters(axes, record=str(records))
    with ros.World(folder / 'world', parameters, ros.plant_parameters({'x': {}})) as one:
        one.records = records
        yield one


def named(world, ended):
    """Wait for a record whose run has ended so."""
    return world.client.until(
        lambda: next((p for p in world.records.glob('*.mcap') if name_of(p).ended == ended), None),
        what=f'a record {ended}',
    )


def test_a_run_is_recorded(world):
    setpoints = world.client.record(JointTrajectory, 'setpoints')
    answer = world.client.home('x')['x']
    assert answer.success, answer.message
    heard = len(setpoints)
    world.client.forget(setpoints)
    file = named(world, 'Homed')
    assert name_of(file).node == 'homing_node' and name_of(file).axis == 'x'
    found = reading.read(file)
    course = found.course
    assert not found.cut and course.outcome.success
    told = answer.message.partition('home_position_raw=')[2].split()[0]
    assert float(told) == pytest.approx(course.outcome.home_position_raw, abs=1e-6)
    assert course.states[0] == 'HSSearch' and 'SecondHSSearch' in course.states
    assert 0.9 * heard <= len(course.samples) <= 1.1 * heard + 5
    assert max(abs(s.position - s.feedback) for s in course.samples) < 0.005
    assert {'home_switch'} <= {each.input for each in course.happenings}
    read = yaml_file.parsed(found.parameters.encode(), file, found.node)
    configuration = yaml_file.checked(read)
    assert configuration.axes['x'].homing_velocity_fast == 0.04
    reader = make_reader(io.BytesIO(file.read_bytes()), True, decoder_factories=[DecoderFactory()])
    assert reader.get_summary().statistics.message_count == sum(
        1 for _ in reader.iter_decoded_messages()
    )


@pytest.mark.long
def test_homing_record_records_a_run_from_outside(world, tmp_path):
    """By the topics alone; the picture and the home are those of the node's own record."""
    own = set(world.records.glob('*.mcap'))
    file = tmp_path / 'run.mcap'
    command = 'import sys; from homing_node.cli import main; sys.exit(main())'
    child = subprocess.Popen(
        [sys.executable, '-c', command, 'record', 'x', '-o', str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'ROS_DOMAIN_ID': str(world.domain.number)},
    )
    try:
        first = child.stdout.readline()
        assert first == 'waiting for a run of x of /homing_node\n', child.communicate()
        answer = world.client.home('x')['x']
        assert answer.success, answer.message
        out, err = child.communicate(timeout=ros.PATIENCE)
    finally:
        child.kill()
    assert (child.returncode, err, out) == (0, '', f'wrote {file}: x NoError\n')
    found = reading.read(file)
    fresh = world.client.until(
        lambda: [
            p for p in set(world.records.glob('*.mcap')) - own if name_of(p).ended == 'Homed'
        ],
        what="the node's own record",
    )
    same = reading.read(fresh[0])
    assert not found.cut and found.course.outcome == same.course.outcome
    assert found.course.states == same.course.states
    assert len(found.course.samples) > 0.8 * len(same.course.samples)
    assert found.node == '/homing_node'
    files = [yaml_file.parsed(one.parameters.encode(), file, one.node) for one in (found, same)]
    assert files[0].values == files[1].values
    switched = [one for one in found.course.happenings if one.input == 'home_switch']
    assert {one.value for one in switched[:2]} == {True, False}
    assert switched[0].position == pytest.approx(0.05, abs=0.005)
    assert max(abs(one.position - one.feedback) for one in found.course.samples) < 0.005
    picture = tmp_path / 'run.png'
    assert cli.main(['plot', str(file)]) == 0
    assert picture.stat().st_size > 10_000


def test_markers_show_home_to_who_comes_late(world):
    markers = world.client.record(MarkerArray, 'markers', ros.LATCHED)
    world.client.until(lambda: markers, what='the markers')
    texts = [one.text for one in markers[-1].message.markers]
    assert any(text.startswith('x: home 0.05') for text in texts), texts
    assert {one.header.frame_id for one in markers[-1].message.markers if one.ns} == {'x'}
    world.client.forget(markers)


def test_the_node_tells_what_it_is_ready_for_and_what_was_asked(world):
    assert not world.client.set(x__homing_velocity_fast=-1.0).successful
    assert world.client.set(x__homing_velocity_fast=0.03).successful
    world.client.trigger('x/cancel')

    def told():
        return world.node.output

    for text in (
        'ready to home x at 250 Hz; setpoints (trajectory) on /homing_node/setpoints; records in',
        'axis x: HSHS toward positive; joint x from /joint_states; home_switch from '
        '/homing_node/x/home_switch, ',
        'the setpoints on /homing_node/setpoints go to /simulated_axes',
        '~/x/home asked for x',
        'axis x: Homed: home_position_raw=',
        'not set: x.homing_velocity_fast',
        'x.homing_velocity_fast is now 0.03 m/s',
        'asked to cancel x',
    ):
        world.client.until(lambda text=text: text in told(), what=text)


def test_of_a_node_that_is_killed_the_run_is_drawn_up_to_there(world, tmp_path, capsys):
    slow = world.client.set(x__homing_velocity_slow=0.0001, x__homing_velocity_fast=0.001)
    assert all(one.successful for one in slow), slow
    world.client.start('x')
    file = named(world, 'Running')
    size = file.stat().st_size
    world.client.until(lambda: file.stat().st_size > size + 4_000, what='some chunks')
    world.client.watch()
    world.node.signal(9)
    world.node.wait()
    world.processes.remove(world.node)
    picture = tmp_path / 'x.png'
    assert cli.main(['plot', str(file), '-o', str(picture)]) == 0
    assert 'drawn up to there' in capsys.readouterr().out
    assert picture.stat().st_size > 10_000
    found = reading.read(file)
    assert found.cut and found.course.outcome is None and len(found.course.samples) > 50
