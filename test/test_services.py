# SPDX-License-Identifier: Apache-2.0
"""What the servers do, without a graph."""

import threading
from types import SimpleNamespace

from homing_node.core.outcome import Outcome
from homing_node.procedures.states import Error
from homing_node.ros.services import Services


def test_what_was_told_before_a_request_counts_before_it():
    """A home switch that has just fallen must not be taken for on."""
    lock, done = threading.Lock(), []
    clock = SimpleNamespace(polled=1.0)

    def poll():
        assert lock.locked()
        clock.polled = 2.0
        done.append('poll')

    def home(names, owner, now, verify=False, jog=None):
        assert lock.locked()
        assert now == 2.0  # no message that was polled is from later
        done.append('home')
        return Outcome(Error.Busy, 'busy')

    def look():
        assert lock.locked()
        done.append('look')

    memories = SimpleNamespace(look=look)
    said = []
    log = SimpleNamespace(warning=said.append)
    services = Services(
        SimpleNamespace(home=home), None, clock, lock, poll, None, memories, None, log
    )
    serving = services.home(['x'], 'me')(None, SimpleNamespace())
    try:
        serving.send(None)
    except StopIteration as ended:
        assert ended.value.message == 'Busy: busy'
    assert done == ['poll', 'look', 'home']
    assert said == ['me refused: Busy: busy']
