# SPDX-License-Identifier: Apache-2.0
"""The node `simulated_axes`: a machine for whoever has none at hand."""
