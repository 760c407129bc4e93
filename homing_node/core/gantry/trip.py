# SPDX-License-Identifier: Apache-2.0
"""A drive of a gantry at rest that tells that its servo went off.

It may be on again: a publisher that keeps its messages tells a node that starts what was before,
and a drive that is switched off and on again tells the first late. No clock: times are passed in.
"""

#: A drive that is off for so long has tripped, s.
LASTS = 0.2


class Trip:
    """Whether a drive has tripped.

    Attributes:
        told: Whether a drive has told that it is off, and it is not known yet whether it stays so.
    """

    def __init__(self) -> None:
        self.told = False
        self._since: float | None = None

    def tell(self) -> None:
        """Take that a drive has told that it went off."""
        self.told, self._since = True, None

    def has_lasted(self, now: float, off: bool) -> bool:
        """Return whether a drive that has told so stays off; ``off``: whether one is off now."""
        if self._since is None or now < self._since:
            self._since = now
        lasted = off and now - self._since >= LASTS
        self.told = off and not lasted
        return lasted
