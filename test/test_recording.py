# SPDX-License-Identifier: Apache-2.0
"""The record of a run: noted in cycles, written in blocks, kept, and read again."""

import errno
import io
import random
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest
from core_rig import HS, home_of, rig
from homing_interfaces.msg import AxisState
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import deserialize_message, serialize_message
from record_rig import OFFSET, PARAMETERS, Recorded

from homing_node.core.outcome import Outcome
from homing_node.memory.disk import Disk
from homing_node.procedures.states import Error, Input
from homing_node.recording import reading
from homing_node.recording.cycles import Cycles
from homing_node.recording.folder import RecordFolder, name_of
from homing_node.recording.heard import BEFORE, Described, Heard, HeardRuns, Said
from homing_node.recording.mcap_file import McapFile
from homing_node.recording.tap import LONGEST_WAIT, MOST_WAITING, Tap
from homing_node.ros import messages
from homing_node.ros.record_messages import RecordMessages, definition
from homing_node.ros.reports import StateReport


def folder_in(path, runs=50, failures=200, disk=None):
    return RecordFolder(path, '/homing_node', runs, failures, disk)


def record_of(one, path, direction=1, **home):
    """Home once and return the rehearsal and the only record."""
    recorded = Recorded(one.rehearsal(direction), folder_in(path))
    recorded.home(**home)
    assert recorded.warnings == []
    (file,) = path.glob('*.mcap')
    return recorded.made, file


def reader_of(path):
    data = io.BytesIO(path.read_bytes())
    return make_reader(data, True, decoder_factories=[DecoderFactory()])


# -- the file ---------------------------------------------------------------------------------


def test_the_library_reads_a_file_back(tmp_path):
    """Indexed, in the order of the times, with schemas and stamps; its checksums hold."""
    _, file = record_of(rig('HSHS'), tmp_path)
    reader = reader_of(file)
    header, summary = reader.get_header(), reader.get_summary()
    assert header.profile == 'ros2' and header.library == 'homing_node 1'
    topics = {one.id: one.topic for one in summary.channels.values()}
    assert {one.message_encoding for one in summary.channels.values()} == {'cdr'}
    assert {one.encoding for one in summary.schemas.values()} == {'ros2msg'}
    counts = {topics[one]: n for one, n in summary.statistics.channel_message_counts.items()}
    assert set(counts) == {
        '/homing_node/setpoints',
        '/joint_states',
        '/homing_node/x/parameters',
        '/homing_node/x/state',
        '/homing_node/x/edges',
        '/homing_node/x/home_switch',
        '/homing_node/x/positive_limit_switch',
        '/homing_node/x/negative_limit_switch',
    }
    found = list(reader.iter_decoded_messages())
    assert len(found) == summary.statistics.message_count == sum(counts.values())
    assert summary.chunk_indexes and summary.statistics.chunk_count > 2
    times = [message.log_time for _, _, message, _ in found]
    assert times == sorted(times) and OFFSET <= times[0] < times[-1] < OFFSET + 60 * 10**9
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (
        times[0],
        times[-1],
    )
    numbers = {}
    for _, channel, message, decoded in found:
        assert message.sequence == numbers.setdefault(channel.topic, 0)
        numbers[channel.topic] += 1
        if hasattr(decoded, 'header') and 'edges' not in channel.topic:
            stamp = decoded.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == message.publish_time
    only = list(reader.iter_decoded_messages(topics=['/joint_states']))
    assert len(only) == counts['/joint_states']
    assert {tuple(one.name) for *_, one in only} == {('x',)}
    metadata = {one.name: one.metadata for one in reader.iter_metadata()}
    assert metadata['homing_node']['axis'] == 'x'
    assert metadata['outcome'] == {'ended': 'Homed', 'lost': '0'}


@pytest.mark.parametrize(
    'kind',
    [
        'homing_interfaces/msg/AxisState',
        'homing_interfaces/msg/SwitchEdge',
        'trajectory_msgs/msg/JointTrajectory',
        'sensor_msgs/msg/BatteryState',
        'sensor_msgs/msg/Imu',
        'control_msgs/msg/DynamicInterfaceGroupValues',
    ],
)
def test_the_definitions_are_those_of_the_types(kind, tmp_path):
    """The library decodes by the definition what rclpy has written."""
    from homing_node.ros.message_types import message_class

    made = message_class(kind)()
    file = tmp_path / 'a.mcap'
    with file.open('wb') as data:
        mcap = McapFile(data, 'test')
        mcap.add(mcap.topic('/a', kind, definition(kind)), 1, 2, serialize_message(made))
        mcap.finish()
    ((_, _, message, decoded),) = reader_of(file).iter_decoded_messages()
    assert (message.log_time, message.publish_time) == (1, 2)
    for name in made.get_fields_and_field_types():
        value, found = getattr(made, name), getattr(decoded, name)
        if isinstance(value, bool | int | float | str):
            assert found == value or value != value
    assert deserialize_message(message.data, type(made)) is not None


def test_blocks_of_several_topics_are_found_in_the_order_of_their_times(tmp_path):
    """Topics are written one after the other, and a late message of an earlier time, too."""
    file = tmp_path / 'a.mcap'
    made = RecordMessages()
    with file.open('wb') as data:
        mcap = McapFile(data, 'test')
        kind = 'std_msgs/msg/String'
        one, other = (mcap.topic(name, kind, definition(kind)) for name in ('/a', '/b'))
        for chunk in range(3):
            for time in (3, 1, 2):
                mcap.add(one, 10 * chunk + time, 7, made.string(f'a{time}'))
                mcap.add(other, 10 * chunk + time, 7, made.string(f'b{time}'))
            mcap.flush()
        mcap.finish()
    reader = reader_of(file)
    found = [(message.log_time, text.data) for *_, message, text in reader.iter_decoded_messages()]
    assert [time for time, _ in found] == [
        10 * c + t for c in range(3) for t in (1, 1, 2, 2, 3, 3)
    ]
    assert {text for time, text in found if time == 12} == {'a2', 'b2'}
    some = reader.iter_decoded_messages(topics=['/b'])
    assert [text.data for *_, text in some] == ['b1', 'b2', 'b3'] * 3


# -- what is in it ----------------------------------------------------------------------------


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('home_type', ['HSHS', 'HSZPulse'])
def test_a_course_is_read_as_it_was(home_type, direction, tmp_path):
    one = rig(home_type)
    made, file = record_of(one, tmp_path, direction)
    assert name_of(file).ended == 'Homed'
    found = reading.read(file)
    assert (found.axis, found.node, found.cut, found.unit) == ('x', '/homing_node', '', 'm')
    assert found.parameters.startswith('/homing_node:')
    course, same = found.course, one.home(direction)
    assert course.states == [state for state in same.states if state != 'Idle']
    assert course.outcome.success
    assert course.outcome.home_position_raw == made.axis.outcome.home_position_raw
    assert course.outcome.uncertainty == made.axis.outcome.uncertainty
    assert course.duration == pytest.approx(same.duration, abs=0.01)
    # The plant follows a setpoint within the cycle; feedback and setpoint are of the same time.
    apart = max(abs(s.position - s.feedback) for s in course.samples)
    assert apart < 0.2 * 0.001
    edges = [(each.input, each.value) for each in course.happenings]
    assert (str(HS), True) in edges
    for each in course.happenings:
        near = [
            abs(other.position - each.position)
            for other in same.happenings
            if (other.input, bool(other.value)) == (each.input, bool(each.value))
        ]
        assert min(near) < 0.001, each


def test_a_run_that_fails_is_a_record_of_its_error(tmp_path):
    one = rig('HS').built(switches={})
    recorded = Recorded(one.rehearsal(), folder_in(tmp_path))
    for switch in recorded.made.axis.parameters.inputs:
        recorded.made.axis.switch(switch, 0.0, False)
    recorded.home()
    (file,) = tmp_path.glob('*.mcap')
    outcome = reading.read(file).course.outcome
    assert name_of(file).ended == outcome.error == recorded.made.axis.outcome.error
    assert not outcome.success and outcome.message == recorded.made.axis.outcome.message


def test_a_run_that_ends_within_a_cycle_is_recorded(tmp_path):
    """No state tells that it runs."""
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path))
    for _ in range(5):
        recorded.cycle()
    axis = recorded.made.axis
    axis.history.add(Error.LimitsBothOn, 0.0)
    axis.outcome = Outcome(Error.LimitsBothOn, 'both')
    recorded.state()
    recorded.state()
    recorded.recorder._write()
    (file,) = tmp_path.glob('*.mcap')
    assert name_of(file).ended == 'LimitsBothOn'


def test_inverted_switches_are_on_where_their_wire_is_false(tmp_path):
    one = rig('HS', invert_hs_polarity=True)
    flag = one.layout.switches[HS]._replace(inverted=True)
    _, file = record_of(one.switched(**{HS: flag}), tmp_path)
    course = reading.read(file).course
    assert course.inverted == {HS}
    (rise, *_) = [each for each in course.happenings if each.input == HS]
    assert rise.value is False


def test_two_runs_are_two_records(tmp_path):
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path))
    recorded.home()
    recorded.home()
    files = sorted(tmp_path.glob('*.mcap'))
    assert [name_of(file).ended for file in files] == ['Homed', 'Homed']
    for file in files:
        course = reading.read(file).course
        assert course.outcome.success and len(course.states) >= 2


def test_polled_switches_have_a_message_for_each_reading(tmp_path):
    one = rig('HS')
    _, file = record_of(one.but(replace(one.transport, poll_rate=50.0)), tmp_path)
    found = [t for t, messages in reading.contents(file).topics.items() if t.endswith(HS)]
    readings = reading.contents(file).topics[found[0]]
    duration = readings[-1].time - readings[0].time
    assert len(readings) == pytest.approx(50.0 * duration, abs=3)


# -- files that end too early -----------------------------------------------------------------


def test_a_file_that_ends_anywhere_is_read_up_to_there(tmp_path):
    _, file = record_of(rig('HSHS'), tmp_path, write_every=10)
    whole = reading.read(file).course
    data = file.read_bytes()
    cut = tmp_path / 'cut.mcap'
    chance = random.Random(1)
    lengths = sorted({0, 1, 8, len(data) - 1, *chance.sample(range(len(data)), 40)})
    known = 0
    for length in lengths:
        cut.write_bytes(data[:length])
        try:
            found = reading.read(cut)
        except reading.NoRun as error:
            assert known == 0, error
            assert str(cut) in str(error)
            continue
        for one, same in zip(found.course.samples, whole.samples, strict=False):
            assert one[:5] == same[:5]
            assert one.feedback == pytest.approx(same.feedback, abs=0.002)  # at the very end
        assert len(found.course.samples) >= known  # a longer file has no less
        known = len(found.course.samples)
        assert found.cut or found.course.outcome == whole.outcome
    assert known == len(whole.samples)


def test_bytes_that_are_wrong_are_noticed(tmp_path):
    """No wrong value is read from a damaged file."""
    _, file = record_of(rig('HS'), tmp_path, write_every=10)
    whole = reading.read(file).course
    data = bytearray(file.read_bytes())
    chance = random.Random(2)
    for place in chance.sample(range(len(data)), 15):
        spoilt = bytearray(data)
        spoilt[place] ^= 0x55
        broken = tmp_path / 'broken.mcap'
        broken.write_bytes(spoilt)
        try:
            found = reading.read(broken)
        except reading.NoRun:
            continue
        times = {sample.time: sample for sample in whole.samples}
        for sample in found.course.samples:
            assert sample.time not in times or sample.position == times[sample.time].position


@pytest.mark.parametrize('data', [b'', b'no MCAP file at all', b'\x89MCAP0\r\n'])
def test_other_files_are_refused(data, tmp_path):
    file = tmp_path / 'x.mcap'
    file.write_bytes(data)
    with pytest.raises(reading.NoRun, match='no MCAP file with ROS 2 messages'):
        reading.read(file)


def test_while_a_run_is_on_its_record_ends_with_the_last_chunk(tmp_path):
    recorded = Recorded(rig('HSHS').rehearsal(), folder_in(tmp_path))
    recorded.home(write_every=25, most=80)
    (file,) = tmp_path.glob('*.mcap')
    assert name_of(file).ended == 'Running'
    found = reading.read(file)
    assert found.cut and found.course.outcome is None
    assert len(found.course.samples) > 60
    recorded.recorder._writings[0].raw.close()


# -- the folder -------------------------------------------------------------------------------


class Names(Disk):
    """A disk of which only the names are kept."""

    def __init__(self):
        self.files = set()

    def create(self, path):
        self.files.add(path)
        return io.BytesIO()

    def rename(self, path, name):
        self.files.remove(path)
        self.files.add(name)

    def delete(self, path):
        self.files.remove(path)

    def names(self, folder):
        return [path.name for path in self.files]


def test_ten_thousand_runs_leave_the_newest(tmp_path):
    disk = Names()
    foreign = tmp_path / '20200101T000000-000000.cell.homing_node.x.Homed.mcap'
    disk.files.add(foreign)
    folder = folder_in(tmp_path, disk=disk)
    kept = {'Homed': [], 'LSTriggered': []}
    for number in range(10_000):
        path, file = folder.begin('x_1', OFFSET + number * 10**9)
        file.close()
        ended = 'LSTriggered' if number % 3 == 0 else 'Homed'
        kept[ended].append(folder.end(path, ended))
        assert len(disk.files) <= 251
        if number % 2_500 == 0:  # the node starts again
            folder = folder_in(tmp_path, disk=disk)
            folder.tidy()
    assert disk.files == {foreign, *kept['Homed'][-50:], *kept['LSTriggered'][-200:]}
    assert {name_of(one).axis for one in disk.files} == {'x', 'x_1'}


def test_no_records_of_runs_or_of_failures(tmp_path):
    folder = folder_in(tmp_path, runs=0, failures=1)
    for ended in ('Homed', 'Timeout', 'Homed', 'Canceled'):
        path, file = folder.begin('x', OFFSET)
        file.close()
        folder.end(path, ended)
    (left,) = tmp_path.iterdir()
    assert name_of(left).ended == 'Canceled'


def test_two_runs_that_begin_at_once_are_two_files(tmp_path):
    folder = folder_in(tmp_path)
    begun = [folder.begin('x', OFFSET) for _ in range(3)]
    for _, file in begun:
        file.close()
    names = [path.name for path, _ in begun]
    assert names == sorted(set(names))


def test_what_a_killed_node_left_is_named_cut_and_counts_as_a_failure(tmp_path):
    folder_in(tmp_path).begin('x', OFFSET)[1].close()
    own = folder_in(tmp_path, failures=1)
    _, file = own.begin('y', OFFSET + 10**9)
    file.close()
    folder_in(tmp_path, failures=1).tidy()
    assert {name_of(one).ended for one in tmp_path.iterdir()} == {'Cut'}


# -- disks --------------------------------------------------------------------------------------


class Full(Disk):
    """A disk that has room for some bytes."""

    def __init__(self, room):
        self.room = room

    def create(self, path):
        super().create(path).close()
        disk = self

        class File(io.BytesIO):
            def write(self, data):
                disk.room -= len(data)
                if disk.room < 0:
                    raise OSError(errno.ENOSPC, 'No space left on device', str(path))
                return super().write(data)

            def flush(self):
                path.write_bytes(self.getvalue())

        return File()


@pytest.mark.parametrize('room', [0, 100, 6_000, 20_000])
def test_a_full_disk_is_one_warning_and_no_failure(room, tmp_path):
    disk = Full(room)
    recorded = Recorded(rig('HSHS').rehearsal(), folder_in(tmp_path, disk=disk))
    for _ in range(2):
        recorded.home(write_every=20)
        assert recorded.made.axis.homed
    (warning,) = recorded.warnings
    assert 'No space left on device' in warning and '(record)' in warning
    disk.room = 10**9
    recorded.home()
    assert len(recorded.warnings) == 1
    newest = max(tmp_path.glob('*.mcap'))
    assert name_of(newest).ended == 'Homed' and reading.read(newest).course.outcome.success
    assert not any(name_of(one).ended == 'Running' for one in tmp_path.glob('*.mcap'))


def test_a_folder_that_cannot_be_made_is_one_warning(tmp_path):
    (tmp_path / 'file').write_text('')
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path / 'file' / 'records'))
    recorded.home()
    assert recorded.made.axis.homed
    (warning,) = recorded.warnings
    assert 'Not a directory' in warning


def test_cycles_of_several_axes_are_packed_together():
    cycles = Cycles(['x', 'y'])
    assert [len(one) for one in cycles.of('x')] == [0, 3]
    cycles.note(0.1, {'x': (1.0, 2.0, 3.0)})
    cycles.note(0.2, {'y': (4.0, 5.0, 6.0), 'x': (7.0, 8.0, 9.0), 'z': (0.0, 0.0, 0.0)})
    assert len(cycles) == 2
    times, numbers = cycles.of('x')
    assert times.tolist() == [0.1, 0.2]
    assert numbers.tolist() == [[1.0, 7.0], [2.0, 8.0], [3.0, 9.0]]
    times, numbers = cycles.of('y')
    assert (times.tolist(), numbers.tolist()) == ([0.2], [[4.0], [5.0], [6.0]])
    assert not len(cycles.of('z')[0])


def test_a_state_that_is_recorded_is_serialized_once():
    published = []
    report = StateReport(AxisState(axis='x'))
    report.publish(SimpleNamespace(publish=published.append))
    report.recorded = True
    report.publish(SimpleNamespace(publish=published.append))
    assert published[0] is report.message and published[1] is report.serialized()
    assert deserialize_message(published[1], AxisState) == report.message


def test_a_disk_that_hangs_costs_no_memory(tmp_path):
    """Nobody takes what is noted."""
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path))
    made = recorded.made
    for _ in range(5):
        made.cycle()
    assert made.axis.home(made.time) is None
    recorded.cycle()
    (tap,) = recorded.recorder.open.values()
    most = int(LONGEST_WAIT / made.period)
    for number in range(most + 99):
        made.axis.readings.switches[Input.HOME_SWITCH].set(number, False, float(number))
        recorded.recorder.cycle(made.time, {})
    assert tap.lost == 100
    for number in range(MOST_WAITING):
        made.axis.readings.switches[Input.HOME_SWITCH].set(number, True, -float(number))
        recorded.recorder.cycle(made.time, {})
    taken = tap.take()
    assert len(taken.drives[0].readings) == MOST_WAITING
    assert sum(map(len, taken.cycles)) == most


def test_feedback_that_nobody_takes_is_bounded(tmp_path):
    made = rig('HS').rehearsal()
    for _ in range(5):
        made.cycle()
    tap = Tap(made.axis, made.time, 0)
    track = made.axis.readings.track
    for number in range(MOST_WAITING + 100):
        track.append(made.time + made.period * (number + 1), 1e-6 * number)
        tap.drives[0].gather()
    taken = tap.take()
    (drive,) = taken.drives
    assert len(drive.feedback) == 2 * MOST_WAITING and tap.lost == 101
    times = list(drive.feedback[::2])
    assert times == sorted(set(times))


def test_two_runs_in_a_row_share_no_cycle(tmp_path):
    """The cycles of all axes are noted together; each run has its own of them."""
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path))
    recorded.home(write_every=10**9)
    recorded.home(write_every=7)
    first, second = (reading.read(file).course for file in sorted(tmp_path.glob('*.mcap')))
    assert first.samples and second.samples
    assert first.samples[-1].time < second.samples[0].time
    assert {round(b.time - a.time, 6) for a, b in pairwise(second.samples)} == {
        recorded.made.period
    }


def test_many_runs_that_wait_for_the_disk_are_told(tmp_path):
    recorded = Recorded(rig('HS').rehearsal(), folder_in(tmp_path))
    axis = recorded.made.axis
    for number in range(30):
        axis.history.add(Error.Timeout, 0.0)
        axis.outcome = Outcome(Error.Timeout, str(number))
        recorded.state()
    recorded.recorder._write()
    assert recorded.warnings == ['the disk is slow: 22 runs are not recorded (record)']
    assert len(list(tmp_path.glob('*.mcap'))) == 8
    assert recorded.recorder._writings == []


def test_nothing_is_noted_without_a_folder():
    recorded = Recorded(rig('HS').rehearsal(), None)
    recorded.home()
    assert recorded.made.axis.homed and not recorded.recorder.open


def test_the_state_in_a_record_is_the_message(tmp_path):
    made, file = record_of(rig('HS'), tmp_path)
    states = reading.contents(file).topics['/homing_node/x/state']
    last = messages.axis_state(0, made.axis)
    for name in AxisState.get_fields_and_field_types():
        if name not in ('header', 'members', 'inputs', 'levels'):
            assert getattr(states[-1].message, name) == getattr(last, name), name
    assert list(states[-1].message.inputs) == last.inputs
    assert home_of(rig('HS').home()) == states[-1].message.home_position_raw


# -- heard from outside -------------------------------------------------------------------------


def test_what_is_heard_from_outside_is_the_same_run(tmp_path):
    """Fed with the node's messages by a host whose clock is 100 s behind, after a long wait."""
    _, file = record_of(rig('HSHS'), tmp_path)
    behind, kind = 100 * 10**9, 'homing_interfaces/msg/AxisState'
    heard = tmp_path / 'heard.mcap'
    described = [Described('x', {'joint': 'x', 'unit': 'm'}, PARAMETERS)]
    messages_of = sorted(reader_of(file).iter_messages(), key=lambda one: one[2].log_time)
    begun = messages_of[0][2].log_time
    with heard.open('wb') as data:
        runs = HeardRuns(data, '/homing_node', '1', lambda: described, RecordMessages())
        idle = serialize_message(AxisState(axis='x', state='Idle'))
        topic = '/homing_node/x/state'
        for before in (30, 20):  # s
            stamp = begun - before * 10**9
            late = 20 * 10**9 if before == 30 else 0  # it was published long ago
            runs.state(
                Heard(topic, kind, stamp + late - behind, idle), Said('x', stamp, True, 'NoError')
            )
        level = RecordMessages().level.one(False)
        runs.take(
            Heard(
                '/homing_node/x/home_switch', 'std_msgs/msg/Bool', begun - behind - 10**10, level
            )
        )
        runs.flush()
        assert not runs.begun and heard.stat().st_size == 0
        for schema, channel, message in messages_of:
            if channel.topic.endswith(('/edges', '/parameters')):
                continue
            one = Heard(channel.topic, schema.name, message.log_time - behind, message.data)
            if schema.name != kind:
                runs.take(one)
                continue
            state = deserialize_message(message.data, AxisState)
            idle_now = state.state == 'Idle'
            runs.state(one, Said('x', message.publish_time, idle_now, state.error))
        assert runs.over and runs.ended == {'x': 'NoError'}
        runs.finish('Cut')
    own, found = reading.read(file), reading.read(heard)
    assert not found.cut and found.parameters == PARAMETERS
    assert found.course.samples == own.course.samples and len(own.course.samples) > 50
    assert found.course.outcome == own.course.outcome
    switched = [(one.input, one.value) for one in found.course.happenings]
    assert switched and switched == [(one.input, one.value) for one in own.course.happenings]
    times = [message.log_time for *_, message in reader_of(heard).iter_messages()]
    assert times[0] == begun - BEFORE
    assert reader_of(heard).get_summary().statistics.message_count == len(times)
