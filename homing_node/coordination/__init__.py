# SPDX-License-Identifier: Apache-2.0
"""What the coordinator decides: which axis of which cell homes when. No ROS, no clock, no I/O.

Events of the cells come in; goals, checks and cancels go out as values (`Ask`). turn_table.py
says what follows from what for one axis; request.py homes several axes in steps; cells.py knows
the cells; coordinator.py holds all of it.
"""
