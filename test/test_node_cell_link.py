# SPDX-License-Identifier: Apache-2.0
"""A coordinator and a cell, each side by itself: no process runs."""

from types import SimpleNamespace

import pytest
import rclpy
import ros_harness as ros
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from homing_interfaces.msg import AxisState
from rclpy.context import Context
from rclpy.serialization import serialize_message

from homing_node.coordination.coordinator import Coordinator
from homing_node.coordination.turn import Ask
from homing_node.coordination.turn_table import Asks
from homing_node.diagnosis.facts import Endpoint
from homing_node.parameters.line import line
from homing_node.procedures.states import Error
from homing_node.ros.cell_link import STATE_TYPE, CellLink
from homing_node.ros.latched import latched_publisher
from homing_node.ros.locks import Permissions


class Topics:
    """Subscriptions whose messages and definitions a test decides on."""

    def __init__(self):
        self.waiting = {}
        self.theirs = 'theirs'

    def subscribe(self, kind, topic, profile, overridable):
        queue = self.waiting.setdefault(topic, [])
        handle = SimpleNamespace(take_message=lambda *_: queue.pop(0) if queue else None)
        return SimpleNamespace(topic_name=topic, handle=handle, msg_type=kind)

    def asked(self, topic, kind):
        return Endpoint('/line', kind, latched=True, definition='ours')

    def offers(self, topic):
        return (Endpoint('/cell1/homing_node', STATE_TYPE, latched=True, definition=self.theirs),)


@pytest.fixture
def node():
    domain, context = ros.Domain(), Context()
    rclpy.init(context=context, domain_id=domain.number)
    made = rclpy.create_node('line', context=context, enable_rosout=False)
    yield made
    made.destroy_node()
    rclpy.shutdown(context=context)
    domain.release()


def test_what_a_node_is_told_of_locks_counts_at_the_next_question_and_wakes_no_executor(node):
    topics = Topics()
    permissions = Permissions(topics, coordinated=False)
    (queue,) = topics.waiting.values()
    assert permissions.refusal('x') is None
    locked = KeyValue(key='x', value='cell1/z is not homed')
    queue.append((DiagnosticStatus(name='/line', hardware_id='1', values=[locked]), {}))
    assert permissions.refusal('x').error is Error.PrerequisiteMissing
    assert queue == []
    assert permissions.refusal('y') is None
    permissions.inactive = 'asleep'
    assert permissions.refusal('y').error is Error.NotActive
    assert latched_publisher(node, DiagnosticStatus, 'locks').event_handlers == []


def test_nothing_is_read_of_a_cell_with_other_messages_and_nothing_asked(node):
    core = Coordinator(line({'nodes': ['/cell1/homing_node'], 'steps': ['cell1/x']}))
    topics, states = Topics(), []
    link = CellLink(
        node,
        core,
        'cell1',
        topics,
        'this process',
        new_axis=lambda axis: None,
        on_state=lambda axis, state: states.append(axis),
        on_unknown=lambda axis, why: None,
        on_event=lambda: None,
    )
    link.watch('cell1/x')

    def say(now):
        data = serialize_message(AxisState(axis='x', homed=True))
        topics.waiting['/cell1/homing_node/x/state'].append(
            (data, {'publication_sequence_number': 1})
        )
        link.poll(now)

    say(0.0)
    assert 'with other fields than the one that is installed here' in link.foreign
    assert not core.cells['cell1'].ever_heard
    asked = []
    link._client = SimpleNamespace(
        server_is_ready=lambda: True,
        send_goal_async=lambda goal: (
            asked.append(goal) or SimpleNamespace(add_done_callback=print)
        ),
    )
    link.ask(Ask(Asks.Check, 1, 'cell1', ('cell1/x',)))
    assert not asked
    topics.theirs = 'ours'  # its package was updated
    say(2.0)
    assert link.foreign == ''
    assert states == ['cell1/x']
    assert len(asked) == 1
