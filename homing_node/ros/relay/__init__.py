# SPDX-License-Identifier: Apache-2.0
"""The node `homed_axes`: raw and homed coordinates, between the controller and its users."""
