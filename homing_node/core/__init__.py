# SPDX-License-Identifier: Apache-2.0
"""One axis and several, without ROS, clock, thread or I/O: time is passed in."""
