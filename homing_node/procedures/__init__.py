# SPDX-License-Identifier: Apache-2.0
"""Home types as tables: the words, the events, the motions, and one table for each home type."""
