# SPDX-License-Identifier: Apache-2.0
"""The node, but its reports break as soon as the file $BREAK is there."""

import os
from pathlib import Path

from homing_node.ros.main import main
from homing_node.ros.reports import Reports

__all__ = ['main']
BREAK = Path(os.environ['BREAK'])


def breaking(states=Reports._next_states):
    def next_states(reports):
        if BREAK.exists():
            raise OSError('the network is gone')
        return states(reports)

    return next_states


Reports._next_states = breaking()
