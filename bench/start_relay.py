# SPDX-License-Identifier: Apache-2.0
"""Runs the relay as a user does."""

import sys

from homing_node.ros.relay.homed_axes import main

if __name__ == '__main__':
    sys.exit(main())
