# SPDX-License-Identifier: Apache-2.0
"""What an axis remembers of its runs, over restarts: doc/memory.md.

disk.py, store.py, folder.py: files that a power cut cannot break. records.py: what is kept.
series.py, trends.py, comparison.py: has the switch moved? restoring.py: may a home be taken over?
No ROS here; the node writes from a thread of its own (ros/memory.py).
"""
