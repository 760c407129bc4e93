# SPDX-License-Identifier: Apache-2.0
"""What a user may set: definitions, bounds, cross-checks, YAML."""
