# SPDX-License-Identifier: Apache-2.0
"""The sheet on which a course is drawn: its lengths, and the sizes of its texts."""

# Lengths on the sheet: in.
WIDTH, LEFT, RIGHT = 7.9, 0.70, 1.85
INNER = WIDTH - LEFT - RIGHT
STRIP = 0.19
# Lengths on the sheet: points.
POINTS = 72.0
SMALL, NORMAL, LARGE = 7.5, 8.5, 10.5
LINE = 11.0
