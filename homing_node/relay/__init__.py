# SPDX-License-Identifier: Apache-2.0
"""What the relay `homed_axes` makes of messages: raw coordinates on one side, homed on the other.

No ROS, no clock, no thread: bytes and messages come in, bytes and messages go out.
"""
