# SPDX-License-Identifier: Apache-2.0
"""Diagrams and plots, and the records that they are drawn from."""
