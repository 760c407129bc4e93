# SPDX-License-Identifier: Apache-2.0
"""A run without ROS: the core against the simulated plant. The node never imports it."""

from .link import DIRECT, Transport
from .run import Rehearsal, rehearse

__all__ = ['DIRECT', 'Rehearsal', 'Transport', 'rehearse']
