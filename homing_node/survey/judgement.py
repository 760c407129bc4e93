# SPDX-License-Identifier: Apache-2.0
"""What the passes of a survey tell: a layout, how exact it is, doubts, and what was not seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, inf
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..plant.layout import NOWHERE, AxisLayout, SwitchLayout
from ..procedures.states import LATCHES, LIMIT_PAIRS, LIMIT_SWITCHES, Error, Input, LSDirection
from .edges import LONGEST_DELAY, Fit, Kind, Range, fit
from .index import Marks, marks_of
from .passes import Pass, SeenEdge, lag_of

#: The kinds of edges, by the end of the flag: where it rises, and on the way back falls.
LOWER = (Kind(True, 1), Kind(False, -1))
UPPER = (Kind(True, -1), Kind(False, 1))

#: An edge is met while the velocity changes if it is slower than its pass by this part of it.
UNSTEADY = 0.02
#: Edges of one switch belong to several flags if they scatter by more than so many times what they
#: may be off, and than this part of the way.
MANY, SCATTER = 20.0, 0.002


class Doubt(NamedTuple):
    """Something that makes no sense, and that only a person can settle.

    Attributes:
        input: The input that it is about, '' if it is about the axis.
        text: What was seen, and what it may mean.
        parameter: The parameter that would have to change, '' for none.
        value: Its value then.
    """

    input: str
    text: str
    parameter: str = ''
    value: object = None


@dataclass
class Survey:
    """What is known of an axis.

    Attributes:
        layout: Where things are. Ends of flags and hard stops that were not seen are infinite.
        exact: How far a number may be off, by the key of the layout file; of a pair by
            ``key[0]`` and ``key[1]``.
        doubts: What only a person can settle.
        advice: Parameters that should have another value, and that value.
        latest: How late a driver may be, s, where that is more than ``switch_stamp_error`` covers
            and not known better; 0: it is covered.
        seen: What was measured besides, in words.
        unseen: What could not be seen, in words.
    """

    layout: AxisLayout
    exact: dict[str, float] = field(default_factory=dict)
    doubts: list[Doubt] = field(default_factory=list)
    advice: dict[str, float] = field(default_factory=dict)
    latest: float = 0.0
    seen: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)


def judge(
    parameters: AxisParameters,
    passes: Sequence[Pass],
    levels: Mapping[Input, bool],
    rates: Mapping[Input, float] | None = None,
    hard_stops: tuple[float, float] = (-inf, inf),
) -> Survey:
    """Return what the passes of a survey tell.

    Args:
        parameters: The parameters of the axis in the survey.
        passes: The motions that were made; at least one.
        levels: The levels of the switches at the start, after polarity.
        rates: How often the message of an input comes, Hz; 0: on change.
        hard_stops: Where the hard stops are, as far as that is known: a survey touches none.
    """
    return _Judgement(parameters, passes, levels, rates or {}, hard_stops).survey()


class _Judgement:
    """Judges the passes of one survey."""

    def __init__(
        self,
        parameters: AxisParameters,
        passes: Sequence[Pass],
        levels: Mapping[Input, bool],
        rates: Mapping[Input, float],
        hard_stops: tuple[float, float],
    ) -> None:
        self._p, self._passes, self._levels, self._rates = parameters, passes, levels, rates
        ends = [place for one in passes for place in (one.begin, one.end)]
        self._low, self._high = min(ends), max(ends)
        self._edges: dict[Input, list[SeenEdge]] = {}
        self._ramps: dict[Input, list[SeenEdge]] = {}  # met while the velocity changed
        for one in passes:
            for edge in one.edges:
                self._take(edge, abs(one.velocity))
        self._switches: dict[str, SwitchLayout] = {}
        start = passes[0].begin
        self._off: dict[str, SwitchLayout] = {}
        self._late: list[Range] = []  # how late the drivers are
        self._found = Survey(AxisLayout(hard_stops, self._switches, self._off, start=start))

    def _take(self, edge: SeenEdge, velocity: float) -> None:
        """Take an edge of a pass that was to go at a velocity."""
        slower = velocity - abs(edge.velocity)
        if edge.input in LATCHES:
            self._edges.setdefault(edge.input, []).append(edge)
        elif slower < UNSTEADY * velocity:  # how far the axis went in a delay is not quite known
            doubt = edge.uncertainty + max(0.0, slower) * LONGEST_DELAY
            edge = edge._replace(uncertainty=doubt)
            self._edges.setdefault(edge.input, []).append(edge)
        else:
            edge = edge._replace(velocity=edge.way * velocity)
            self._ramps.setdefault(edge.input, []).append(edge)

    def survey(self) -> Survey:
        """Return what the passes tell."""
        found = self._found
        self._failure()
        for name in self._p.inputs:
            if name in LATCHES or name is Input.SERVO_ENABLED:
                continue
            edges, ramps = self._edges.get(name, []), self._ramps.get(name, [])
            if edges or ramps:
                self._switch(name, edges, ramps)
            else:
                self._silent(name)
        self._advise_latency()
        self._index()
        self._probe()
        self._motion()
        rate = min((rate for rate in self._rates.values() if rate > 0.0), default=0.0)
        if self._rates:
            found.layout = found.layout._replace(switch_rate=rate)
        for stop, end in zip(found.layout.hard_stops, ('lower', 'upper'), strict=True):
            if abs(stop) == inf:
                found.unseen.append(f'the {end} hard stop: a survey does not touch it; measure it')
        return found

    def _failure(self) -> None:
        last = self._passes[-1]
        if self._ended_early:
            said = last.message.removeprefix(f'{last.error}: ')
            named = '' if last.error is Error.InternalError else f', {last.error}'
            self._found.unseen.append(
                f'what is beyond {last.end:.6g} {self._p.unit}: the survey ended there'
                f'{named}: {said}'
            )
        if last.error is Error.FollowingError:
            self._found.unseen.append(
                f'why the axis did not follow at {last.end:.6g} {self._p.unit}: if it stands at a '
                'hard stop, write the stop into the file, and survey with a shorter --within from '
                'further away; a survey must not reach a hard stop'
            )

    @property
    def _ended_early(self) -> bool:
        """Whether the last motion failed, so that not all of the way was seen."""
        return self._passes[-1].error not in (Error.NoError, Error.LSTriggered)

    # ----------------------------------------------------------------------------------- switches

    def _switch(self, name: Input, edges: Sequence[SeenEdge], ramps: Sequence[SeenEdge]) -> None:
        """Judge a switch that has changed."""
        found, unit = self._found, self._p.unit
        wrong = self._reads_wrongly(name, [*edges, *ramps])
        if wrong:
            edges = [edge._replace(level=not edge.level) for edge in edges]
            ramps = [edge._replace(level=not edge.level) for edge in ramps]
        kinds = fit(edges, ramps, -self._p.switch_latency)
        doubt = max(edge.uncertainty for edge in [*edges, *ramps])
        scatter = kinds.spread * doubt
        if scatter > max(MANY * doubt, SCATTER * (self._high - self._low)):
            text = (
                f'{name} changes at places that are up to {unit.length(2.0 * scatter)} apart: has '
                'it two flags, is it loose, or do its contacts bounce?'
            )
            found.doubts.append(Doubt(name, text))
            return
        if kinds.spread > 1.0:
            found.seen.append(
                f'{name} repeats to ± {unit.length(scatter)}, though its edges say ± '
                f'{unit.length(doubt)}: switch_stamp_error is too small, or it is loose'
            )
        hysteresis = self._hysteresis(name, kinds)
        low = _end(kinds, LOWER, 1, hysteresis)
        high = _end(kinds, UPPER, -1, hysteresis)
        on_from = -inf if low is None else low.middle
        on_to = inf if high is None else high.middle
        self._switches[name] = SwitchLayout(
            on_from,
            max(on_from, on_to),
            0.0 if hysteresis is None else hysteresis.middle,
            self._p.inverted(name) is not wrong,
        )
        for n, end in enumerate((low, high)):
            if end is not None:
                found.exact[f'{name}[{n}]'] = end.half
        if hysteresis is not None:
            found.exact[f'{name}_hysteresis'] = hysteresis.half
        self._delay(name, kinds.delay)

    def _hysteresis(self, name: Input, kinds: Fit) -> Range | None:
        """Return the hysteresis; None where no end of the flag was met both ways."""
        found: list[Range] = []
        for (rise, fall), way in ((LOWER, 1), (UPPER, -1)):
            rises, falls = kinds.places.get(rise), kinds.places.get(fall)
            if rises is not None and falls is not None:
                gap = rises.minus(falls) if way > 0 else falls.minus(rises)
                found.append(Range(max(0.0, gap.low), max(0.0, gap.high)))
        if not found:
            text = f'the hysteresis of {name}: no end of it was met both ways; taken as 0'
            self._found.unseen.append(text)
            return None
        common = found[0].common(found[-1])
        if common is None:
            low, high = (self._p.unit.length(one.middle) for one in found)
            self._found.seen.append(
                f'{name} has two hystereses: {low} at its lower end, {high} at its upper one'
            )
        return common or found[0].hull(found[-1])

    def _delay(self, name: Input, delay: Range) -> None:
        """Tell how late the driver of a switch is."""
        if delay.high >= LONGEST_DELAY:
            text = f'how late the driver of {name} is: it was met at one velocity only'
            self._found.unseen.append(text)
            return
        self._late.append(delay)
        least, most = (1e3 * (self._p.switch_latency + end) for end in delay)
        self._found.seen.append(
            f'the driver of {name} publishes {least:.3g} to {most:.3g} ms after the edge'
        )

    def _advise_latency(self) -> None:
        """Advise how much delay the node should take off: the same for all switches."""
        common: Range | None = Range(-inf, inf)
        for delay in self._late:
            common = common and common.common(delay)
        if not self._late or common is None:
            return
        now, error = self._p.switch_latency, self._p.switch_stamp_error
        if common.low <= 0.0 <= common.high:
            if common.high > error:
                self._found.latest = latest = _up(common.high)
                self._found.unseen.append(
                    f'whether the drivers are later than {1e3 * error:g} ms (switch_stamp_error): '
                    f'they may be {1e3 * latest:g} ms late; a survey with a higher --velocity '
                    f'tells, and switch_stamp_error: {latest:g} covers it'
                )
            return
        right, doubt = round(now + common.middle, 4), round(error + common.half, 4)
        self._found.advice |= {'switch_latency': right, 'switch_stamp_error': doubt}
        self._found.seen.append(
            f'set switch_latency: {right:g} (it is {now:g} s), and switch_stamp_error: {doubt:g} '
            f'(it is {error:g} s), for the delay is not known better'
        )

    def _reads_wrongly(self, name: Input, edges: Sequence[SeenEdge]) -> bool:
        """Doubt the polarity or the end of a switch; return whether its polarity is wrong."""
        # At a place where the level changes, which side is on: the upper (1) or the lower one?
        changes = sorted((edge.position, edge.way if edge.level else -edge.way) for edge in edges)
        (low, first), (high, last) = changes[0], changes[-1]
        length = self._high - self._low
        on = (high - low if first > 0 > last else 0.0) + (
            (self._high - low if first == last == 1 else 0.0)
            + (high - self._low if first == last == -1 else 0.0)
            + (length - (high - low) if first < 0 < last else 0.0)
        )
        if name in LIMIT_SWITCHES:
            return self._limit_reads_wrongly(name, first, last, on > 0.5 * length)
        wrong = first < 0 < last and on > 0.5 * length
        if wrong:
            self._doubt_polarity(name, f'off between {low:.6g} and {high:.6g} {self._p.unit} only')
        return wrong

    def _limit_reads_wrongly(self, name: Input, first: int, last: int, mostly_on: bool) -> bool:
        upper = any(name is pair[0] for pair in LIMIT_PAIRS.values())
        if self._p.ls_direction is LSDirection.Reverse:
            upper = not upper
        own = 1 if upper else -1
        if own in (first, last):
            return False
        if mostly_on:
            self._doubt_polarity(name, 'on nearly all the way, but off at its end')
            return True
        now = self._p.ls_direction
        other = LSDirection.Normal if now is LSDirection.Reverse else LSDirection.Reverse
        end = 'lower' if upper else 'upper'
        text = f'{name} is on at the {end} end: are the two limit switches swapped?'
        self._found.doubts.append(Doubt(name, text, 'ls_direction', other))
        return False

    def _doubt_polarity(self, name: Input, seen: str) -> None:
        parameter = f'invert_{name}_polarity'
        parameter = parameter.replace('home_switch', 'hs').replace('limit_switch', 'ls')
        inverted = self._p.inverted(name)
        text = f'{name} is {seen}: is it read the wrong way round?'
        self._found.doubts.append(Doubt(name, text, parameter, not inverted))

    def _silent(self, name: Input) -> None:
        """Judge a switch that has not changed."""
        way = f'between {self._low:.6g} and {self._high:.6g} {self._p.unit}'
        level = self._levels.get(name)
        if level is None:
            text = f'{name}: no message of it has come; is it wired, and published?'
            self._found.unseen.append(text)
        elif level and self._ended_early:
            self._found.unseen.append(f'{name}: it was on {way}, which is not the whole way')
        elif level:
            self._doubt_polarity(name, f'on all the way {way}')
        else:
            self._found.unseen.append(f'{name}: it stayed off {way}')
            if name in LIMIT_SWITCHES:
                self._off[name] = NOWHERE._replace(inverted=self._p.inverted(name))

    # ------------------------------------------------------------------------------- index, probe

    def _index(self) -> None:
        """Find the marks of an encoder index."""
        pulses, found = self._edges.get(Input.Z_PULSE), self._found
        if Input.Z_PULSE not in self._p.inputs:
            return
        try:
            marks = marks_of(pulses or ())
        except ValueError as error:
            found.doubts.append(Doubt(Input.Z_PULSE, str(error)))
            return
        if isinstance(marks, Marks):
            pitch, offset = marks.pitch, marks.offset
            found.layout = found.layout._replace(index_pitch=pitch, index_offset=offset)
            found.exact |= {'index_pitch': marks.pitch_half, 'index_offset': marks.offset_half}
        elif marks is None:
            found.unseen.append('the index: no pulse was latched')
        else:
            found.unseen.append(
                f'the pitch of the index: one pulse alone was latched, at {marks:.6g} '
                f'{self._p.unit}; survey further'
            )

    def _probe(self) -> None:
        """Find the touch plate."""
        if Input.TOUCH_PROBE not in self._p.inputs:
            return
        touches = self._edges.get(Input.TOUCH_PROBE)
        if not touches:
            self._found.unseen.append('the touch probe: it did not trigger')
            return
        places = [one.position for one in touches]
        middle = 0.5 * (min(places) + max(places))
        self._found.layout = self._found.layout._replace(touch_probe=middle)
        doubt = max(one.uncertainty for one in touches)
        self._found.exact['touch_probe'] = 0.5 * (max(places) - min(places)) + doubt

    # ------------------------------------------------------------------------------------- motion

    def _motion(self) -> None:
        """Tell how far the axis stays behind, and how far it goes on behind a limit switch."""
        found, unit = self._found, self._p.unit
        lag = lag_of(self._passes)
        if lag is None:
            found.unseen.append('the lag of the drive: no pass was long enough')
        else:
            found.layout = found.layout._replace(lag=lag)
        for one in self._passes:
            if one.overrun is not None:
                found.seen.append(
                    f'from {abs(one.velocity):g} {unit}/s the axis stops within '
                    f'{unit.length(one.overrun)} behind a limit switch'
                )
                break


def _up(delay: float) -> float:
    """Return a delay rounded up to 0.1 ms."""
    return ceil(1e4 * delay) / 1e4


def _end(kinds: Fit, end: tuple[Kind, Kind], way: int, hysteresis: Range | None) -> Range | None:
    """Return where an end of a flag is: where it rises; or falls, less its hysteresis."""
    rises, falls = (kinds.places.get(kind) for kind in end)
    if rises is not None or falls is None:
        return rises
    gap = hysteresis or Range(0.0, 0.0)
    low, high = (gap.low, gap.high) if way > 0 else (-gap.high, -gap.low)
    return Range(falls.low + low, falls.high + high)
