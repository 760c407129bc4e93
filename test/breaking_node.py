# SPDX-License-Identifier: Apache-2.0
"""The node, but a part of it breaks as soon as the file $BREAK is there, which names the part.

That is `reports`, `inputs`, or a home type: the runs of that type break.
"""

import os
from pathlib import Path

from homing_node.core.machine import Machine
from homing_node.ros.inputs import Inputs
from homing_node.ros.main import main
from homing_node.ros.reports import Reports

__all__ = ['main']
BREAK = Path(os.environ['BREAK'])


def breaking(method, part_of):
    """Return the method, which raises if it belongs to the part that shall break."""

    def broken(self, *args):
        if BREAK.exists() and BREAK.read_text() == part_of(self):
            raise OSError('the network is gone')
        return method(self, *args)

    return broken


Reports._next_states = breaking(Reports._next_states, lambda _: 'reports')
Inputs.poll = breaking(Inputs.poll, lambda _: 'inputs')
Machine.update = breaking(Machine.update, lambda machine: machine.parameters.home_type)
