# SPDX-License-Identifier: Apache-2.0
"""Other coordinators that guard cells of this line."""

#: Another coordinator that was not heard for this time is gone, s.
GONE = 3.0


class Claims:
    """What other coordinators claim: each by its identity, with its name and when it spoke."""

    def __init__(self) -> None:
        self._heard: dict[str, tuple[str, float]] = {}

    def take(self, identity: str, name: str, now: float) -> None:
        """Take that another coordinator guards a cell of ours."""
        self._heard[identity] = name, now

    def living(self, now: float) -> str:
        """Return the names of the coordinators that live, '' if there is none."""
        names = {name for name, heard in self._heard.values() if now - heard < GONE}
        return ', '.join(sorted(names))
