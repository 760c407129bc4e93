# SPDX-License-Identifier: Apache-2.0
"""Where things are on a machine, and a simulated one."""
