# SPDX-License-Identifier: Apache-2.0
"""The record of each run: an MCAP file with ROS 2 schemas. No ROS is needed to read one."""
