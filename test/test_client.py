# SPDX-License-Identifier: Apache-2.0
"""What the client of a script does where no answer comes."""

from types import SimpleNamespace

import pytest
from rclpy.task import Future

from homing_node.client import HomingClient


@pytest.mark.parametrize(
    ('timeout', 'there', 'text'),
    [(None, False, 'has ended, or is out of reach'), (0.1, True, 'did not answer within 0.1 s')],
    ids=['gone', 'silent'],
)
def test_no_answer_comes(timeout, there, text):
    client = SimpleNamespace(node_name='/homing_node')
    with pytest.raises(TimeoutError, match=f'/homing_node {text}'):
        HomingClient._wait(client, Future(), timeout, lambda: there)
