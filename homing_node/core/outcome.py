# SPDX-License-Identifier: Apache-2.0
"""Why a run fails, and how it ended."""

from typing import NamedTuple

from ..procedures.states import Error


class Failure(NamedTuple):
    """Why a run cannot go on: the error, what was seen, what may be the reason."""

    error: Error
    seen: str
    hint: str = ''


class Outcome(NamedTuple):
    """How a run ended (or why a request was refused), and where home is, raw, m.

    ``passes_range`` and ``passes_deviation`` (standard deviation) in m are those of the ``passes``
    over the reference; ``index_margin`` the distance from the arming edge to the first Z-pulse in
    pitches, None where it is not known.
    """

    error: Error
    message: str = ''
    home_position_raw: float = 0.0
    home_offset: float = 0.0
    uncertainty: float = 0.0
    passes: int = 0
    passes_range: float = 0.0
    passes_deviation: float = 0.0
    index_margin: float | None = None
    warnings: tuple[str, ...] = ()

    @property
    def success(self) -> bool:
        return self.error is Error.NoError
