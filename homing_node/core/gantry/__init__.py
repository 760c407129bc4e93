# SPDX-License-Identifier: Apache-2.0
"""An axis that several drives move: its sides home square, without racking."""
