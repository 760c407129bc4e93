# SPDX-License-Identifier: Apache-2.0
"""Compares each run with those before it: has something moved?

An absolute encoder shows the raw home of all runs in the same coordinates. An incremental one does
so as long as it has power: a *frame* says which runs can be compared. Distances between things of
the machine can always be compared. Statistics warn; only `home_change_limit` stops.
"""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..parameters.units import Unit
from ..procedures.states import Encoder
from .quantities import HOME, INDEX
from .records import Run
from .series import Comparison, Series
from .trends import Trend, trend_of
from .words import about_pitches, words_of


class Rules(NamedTuple):
    """What the comparison must know of an axis.

    Attributes:
        warn: A larger change is a warning, m or rad; 0: only by statistics.
        limit: A larger change is no home; 0: there is no limit.
        turn: By what raw homes repeat; 0: they do not.
        unit: The unit of the axis.
    """

    warn: float = 0.0
    limit: float = 0.0
    turn: float = 0.0
    unit: Unit = Unit.m


def rules_of(p: AxisParameters) -> Rules:
    """Return the rules that the parameters of an axis make."""
    turn = p.encoder_turn if p.encoder is Encoder.single_turn else 0.0
    return Rules(p.home_change_warn, p.home_change_limit, turn, p.unit)


class Judgement(NamedTuple):
    """What the comparison says of a run: warnings, and why its home is not taken ('': it is)."""

    warnings: tuple[str, ...] = ()
    moved: str = ''


class Memory:
    """The runs of one axis, compared.

    Attributes:
        runs: All runs, the newest last.
    """

    def __init__(self, rules: Rules, configuration: str) -> None:
        """Begin without a run; see :meth:`replay`.

        Args:
            rules: What is compared how.
            configuration: The hash of everything that moves the origin.
        """
        self.runs: list[Run] = []
        self._rules, self._configuration = rules, configuration
        self._series: dict[str, Series] = {}
        self._frame = ''

    def replay(self, runs: Iterable[Run]) -> None:
        """Take the runs that were kept, with the present rules."""
        self.runs, self._series, self._frame = [], {}, ''
        for run in runs:
            self.add(run)

    def configure(self, rules: Rules, configuration: str) -> None:
        """Use new rules; a changed configuration has another baseline."""
        self._rules, self._configuration = rules, configuration
        self.replay(self.runs)

    @property
    def next_number(self) -> int:
        return self.runs[-1].number + 1 if self.runs else 1

    def judge(self, run: Run) -> Judgement:
        """Compare a run with the baseline; :meth:`add` keeps it."""
        rules, warnings, moved = self._rules, [], ''
        for name, (value, least) in run.quantities.items():
            series = self._series_of(name, run, make=False)
            if series is None:
                continue
            found = series.compare(value, least, run.number, self._tolerated)
            if not found.known or not found.suspicious:
                continue
            text = self._text(name, found, run)
            size = abs(found.change)
            if rules.limit and size > rules.limit:
                limit = rules.unit.length(rules.limit)
                moved = moved or f'{text}, more than {limit} (home_change_limit)'
            elif (rules.warn and size > rules.warn) or series.suspicious:
                warnings.append(text)
        return Judgement(tuple(warnings), moved)

    def add(self, run: Run) -> None:
        """Keep a run."""
        self.runs.append(run)
        if run.configuration != self._configuration:
            return
        if run.accepted:
            self._series.clear()
        for name, (value, least) in run.quantities.items():
            series = self._series_of(name, run, make=True)
            if series is not None:
                series.add(value, least, run.number, self._tolerated)

    def accept(self) -> Run | None:
        """Begin a new baseline with the last run that has found a home; return it, or None."""
        for place in range(len(self.runs) - 1, -1, -1):
            run = self.runs[place]
            if run.home is not None and run.configuration == self._configuration:
                self.runs[place] = accepted = run.but_accepted()
                self.replay(self.runs)
                return accepted
        return None

    def trends(self) -> tuple[str, ...]:
        """Say what the values of many runs do; takes some milliseconds."""
        found = []
        for name, series in list(self._series.items()):
            values = list(series.values)
            trend = trend_of(values)
            if trend is None and series.suspicious >= 2:
                trend = Trend('step', series.since or 0, values[-1].value - series.centre)
            if trend is not None:
                found.append(words_of(trend, name, self._rules.unit, self._pitch, self.when))
        return tuple(found)

    def series(self, name: str = HOME) -> Series | None:
        """Return the values of a quantity in the present frame, None if there are none."""
        return self._series.get(name)

    def names(self) -> Sequence[str]:
        """Return the names of the quantities."""
        return list(self._series)

    def when(self, number: int) -> str:
        """Return the words for a run: its number, and its time if it is kept."""
        run = next((one for one in reversed(self.runs) if one.number == number), None)
        if run is None:
            return f'run {number}'
        return f'run {number} ({datetime.fromtimestamp(run.time):%Y-%m-%d %H:%M})'

    # ------------------------------------------------------------------------------------- inside

    @property
    def _tolerated(self) -> float:
        """The smallest change that the user wants to hear of, m or rad; 0: by statistics."""
        rules = self._rules
        return min((one for one in (rules.warn, rules.limit) if one), default=0.0)

    @property
    def _pitch(self) -> float:
        return next((run.pitch for run in reversed(self.runs) if run.pitch), 0.0)

    def _series_of(self, name: str, run: Run, make: bool) -> Series | None:
        """Return the series that a run continues, None if there is none."""
        if name == HOME and run.frame != self._frame:
            if not make:
                return None
            self._frame = run.frame
            self._series.pop(HOME, None)
        if name not in self._series and make:
            self._series[name] = Series(self._period(name, run))
        return self._series.get(name)

    def _period(self, name: str, run: Run) -> float:
        if name == INDEX:
            return run.pitch
        return self._rules.turn if name == HOME else 0.0

    def _text(self, name: str, found: Comparison, run: Run) -> str:
        unit = self._rules.unit
        since = self.when(found.since or run.number) if found.since != run.number else 'this run'
        pitches = about_pitches(found.change, run.pitch if name == HOME else 0.0)
        return (
            f'{name} moved by {unit.length(found.change, sign=True)} since {since}{pitches}; it '
            f'was steady within {unit.length(found.scale)}'
        )
