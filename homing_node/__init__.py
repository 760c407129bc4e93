# SPDX-License-Identifier: Apache-2.0
"""Homes machine axes."""
