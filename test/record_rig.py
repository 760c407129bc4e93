# SPDX-License-Identifier: Apache-2.0
"""Records of rehearsed runs: the recorder of the node, without its thread and without a graph."""

import threading
from types import SimpleNamespace

from homing_node.ros import messages
from homing_node.ros.recorder import Recorder
from homing_node.ros.reports import StateReport

#: How much stamps are ahead of the time of a rehearsal, ns.
OFFSET = 1_795_000_000 * 10**9
#: The parameters of an axis x, as they stand in a record.
PARAMETERS = (
    '/homing_node:\n  ros__parameters:\n    axes: [x]\n    x: {home_type: HS, travel: 0.1}\n'
)


class Recorded:
    """A rehearsal whose runs are recorded.

    Attributes:
        made: The rehearsal.
        recorder: The recorder.
        warnings: What was logged.
    """

    def __init__(self, made, folder, parameters=PARAMETERS):
        self.made, self.warnings = made, []
        self.recorder = Recorder(
            '/homing_node',
            {name: name.rpartition('.')[2] for name in made.axis.drives},
            '/joint_states',
            made.period,
            folder,
            SimpleNamespace(now=0.0, offset=OFFSET),
            lambda axis: (
                {'version': '1', 'axis': axis.name, 'joint': axis.name, 'unit': 'm'},
                parameters,
            ),
            threading.Lock(),
            SimpleNamespace(warning=self.warnings.append),
        )
        self._last = None

    def state(self):
        """Publish the state, as the node does at each change."""
        axis = self.made.axis
        stamp = OFFSET + round(self.made.time * 1e9)
        self.recorder.state(axis, stamp, StateReport(messages.axis_state(stamp, axis)))

    def cycle(self):
        """Do what the node does in a cycle."""
        made = self.made
        setpoint = made.cycle()
        self.recorder._timebase.now = made.time
        if self._last != (now := (made.axis.fingerprint, made.axis.state)):
            self._last = now
            self.state()
        if self.recorder.open:
            told = {made.axis.name: setpoint}
            told |= {one.name: one.setpoint for one in getattr(made.axis, 'followers', ())}
            self.recorder.cycle(made.time, {} if setpoint is None else told)

    def home(self, write_every=20, most=100_000):
        """Home once, and write what was noted now and then."""
        for _ in range(5):
            self.cycle()
        assert self.made.axis.home(self.made.time) is None
        for number in range(most):
            self.cycle()
            if not self.made.axis.running:
                break
            if number % write_every == write_every - 1:
                self.recorder._write()
        self.recorder._write()
