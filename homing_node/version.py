# SPDX-License-Identifier: Apache-2.0
"""The version of this package, for the records."""

from importlib import metadata


def version() -> str:
    """Return the version, 'unknown' where the sources run without being installed."""
    try:
        return metadata.version('homing_node')
    except metadata.PackageNotFoundError:
        return 'unknown'
