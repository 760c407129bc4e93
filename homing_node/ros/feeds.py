# SPDX-License-Identifier: Apache-2.0
"""One topic and the inputs that come from it: each message is read once, for all of them.

Several inputs of several axes may come from one topic. Most messages repeat what the message
before said: then each switch only notes the time.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..core.axis import Axis
from ..core.in_step import LONG, InStep
from ..core.signals import Switch
from ..core.stamps import REORDERED, Stamps, too_late
from ..language.cdr import Broken
from ..language.expression import BadExpression
from ..language.reader import NOT_MINE, Missing, Reader, Reading, Said
from ..language.resolve import bind
from ..procedures.states import LATCHES, Error, FeedbackClock, Input
from . import message_types
from .adapting import Asked
from .joint_feedback import REORDERED_MESSAGES
from .polling import Info, Take, taker
from .stamp_groups import Judging, grouped
from .timebase import TimeBase
from .wired_input import BOOL, WiredInput, default_value

#: In simulated time an edge is as old as its message's way, and the next cycle sees it: up to this
#: many periods lie between.
UNSTAMPED = 2.0


class Feed:
    """A topic, its subscription and its inputs.

    Attributes:
        topic: the full name of the topic.
        inputs: the inputs that come from it.
        asked: the type and the QoS of the subscription; a type of '' is not known yet.
        subscription: None where there is none yet.
        take: takes its next message.
        publishers: how many publishers matched the subscription when it was looked last.
        offered: how many publishers the topic had then, also such that do not match.
        problem: why no message arrives, or none can be read.
        unfit: whether the problem is one of the parameters.
        looked: whether the graph has been looked at since the publishers changed.
        since: when the subscription was made, s.
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.inputs: list[WiredInput] = []
        self.asked = Asked('')
        self.subscription: Any = None
        self.take: Take = _nothing
        self.publishers = self.offered = 0
        self.problem = ''
        self.unfit = False
        self.looked = False
        self.since = 0.0
        self._number = 0  # of the newest message
        self._reader = Reader(message_types.layout(BOOL), ())
        self._read: list[WiredInput] = []  # those whose expression fits, as the reader has them
        self._groups: list[_Group] = []
        self._known: dict[Hashable, Stamps] = {}
        self._steady = False  # every input was said by the last message, and it may be said again
        self._repeats = 0  # messages in a row that have said the same

    @property
    def feeds_axes(self) -> bool:
        """Whether feedback comes from it: it is read after all switches."""
        return any(one.is_feedback for one in self.inputs)

    @property
    def matters(self) -> bool:
        """Whether a lost message matters."""
        return not all(one.is_feedback for one in self.inputs)

    @property
    def told(self) -> bool:
        return any(one.told for one in self.inputs)

    @property
    def in_use(self) -> bool:
        """Whether an axis that needs it homes."""
        return any(one.axis.running for one in self.inputs)

    @property
    def heard(self) -> bool:
        """Whether every input has been heard."""
        return bool(self.publishers) and all(one.heard for one in self.inputs)

    def count(self) -> int:
        """Return how many publishers match the subscription now."""
        return 0 if self.subscription is None else int(self.subscription.get_publisher_count())

    def default(self) -> Asked | str:
        """Return what to ask for while nobody publishes, or why there is nothing to ask for."""
        told = sorted({one.told for one in self.inputs if one.told})
        if len(told) > 1:
            return f'types says that {self.topic} is of {" and of ".join(told)}'
        kinds = sorted({one.default_kind for one in self.inputs} - {''})
        if not told and any(not one.default_kind for one in self.inputs):
            return Asked('', self.matters)
        if not told and len(kinds) > 1:
            return f'{self.topic} has the inputs of {" and of ".join(kinds)}'
        return Asked(told[0] if told else kinds[0] if kinds else '', self.matters)

    def subscribe(self, subscription: Any, asked: Asked, now: float) -> None:
        """Take the messages of another subscription from now on, s."""
        self.subscription, self.asked, self.since = subscription, asked, now
        self.take = taker(subscription, serialized=True)
        self._known.clear()  # it may be another publisher
        self.publishers = self.count()

    def unsubscribe(self) -> None:
        """Take no more messages."""
        self.subscription, self.take, self.publishers = None, _nothing, 0

    def bind(self) -> None:
        """Fit the expressions to the type, and follow changed parameters of the axes."""
        self._read = []
        bounds = []
        try:
            layout = message_types.layout(self.asked.kind or BOOL)
        except BadExpression as error:
            self.problem, self.unfit = str(error), True
            return
        for one in self.inputs if self.asked.kind else ():
            try:
                bounds.append(bind(one.written, layout, default_value(layout.names, one.joint)))
            except BadExpression as error:
                one.problem = str(error)
            else:
                one.problem = ''
                self._read.append(one)
        self._reader = Reader(layout, bounds)
        self._steady = False
        self.regroup()

    def regroup(self) -> None:
        """Group the inputs by who judges the stamps alike."""
        members = []
        for number, one in enumerate(self._read):
            p = one.axis.parameters
            clock = p.feedback_clock if one.is_feedback else p.switch_clock
            judging = Judging(p.feedback_timeout, clock, REORDERED if one.is_feedback else 0)
            members.append(((one.axis.name, one.is_feedback), judging, number))
        self._end_sharing()
        self._groups = [
            _Group(stamps, self._by_axis(numbers))
            for stamps, numbers in grouped(members, self._known)
        ]
        self._reader.forget()

    def _by_axis(self, numbers: Sequence[int]) -> list['_Part']:
        parts: dict[str, _Part] = {}
        for number in numbers:
            one = self._read[number]
            part = parts.setdefault(one.axis.name, _Part(one.axis, [], [], one.is_feedback))
            part.numbers.append(number)
            if one.is_switch:
                part.switches.append(Input(one.source))
        return list(parts.values())

    def _share_times(self) -> None:
        """Let switches that have repeated their levels for long share the times of messages."""
        for group in self._groups:
            alike: dict[tuple[float, float], list[Switch]] = {}
            for part in group.parts:
                p, known = part.axis.parameters, part.axis.readings.switches
                switches = alike.setdefault((p.switch_latency, p.switch_stamp_error), [])
                switches += [known[one] for one in part.switches]
            if any(one.level is None or one.unsettled for each in alike.values() for one in each):
                self._repeats = 0  # later
            elif not group.parts[0].is_feedback:
                group.in_step = [InStep(each, *judged) for judged, each in alike.items()]

    def _end_sharing(self) -> None:
        """Give each switch times of its own again."""
        self._repeats = 0
        for group in self._groups:
            for one in group.in_step:
                one.end()
            group.in_step = []

    def silence(self) -> None:
        """Take that no publisher is there any more; end the runs that need it."""
        for one in self.inputs:
            if one.is_feedback:
                continue  # its age ends a run
            one.lose()
            if one.is_temperature:
                one.axis.temperature = None
            elif one.axis.moving:
                one.axis.stop(Error.SwitchStale, f'{one.name} lost its publisher')
        self._reader.forget()

    # ------------------------------------------------------------------------------- each message

    def receive(
        self, data: bytes, info: Info, clock: TimeBase, stop: Callable[[Axis, Error, str], None]
    ) -> bool:
        """Give what a message says to the axes; return whether it could be read.

        Args:
            data: the message.
            info: what the middleware says of it.
            clock: the clock of the node.
            stop: ends a run of an axis for a message that was too late.
        """
        try:
            reading = self._reader.read(data)
        except Broken as error:
            for one in self._read:
                self._lose(one, f'the message is no {self.asked.kind}: {error}')
            self._steady = False
            self._reader.forget()
            return False
        self._watch_publisher(info)
        clock.relate()
        arrival = stamp = clock.polled
        sent: float | None = None  # without a header there is one time
        if not clock.simulated:
            arrival = min(arrival, clock.time_of(info['received_timestamp']))
            stamp = clock.time_of(info['source_timestamp'])
        if reading.stamp:
            sent, stamp = stamp, clock.time_of(reading.stamp)
        # What the publisher has kept from before says nothing of how often it publishes.
        kept = not clock.simulated and (stamp if sent is None else sent) < self.since
        repeats = reading.same and self._steady and not kept
        if not reading.same:
            self._steady = all(map(_may_repeat, self._read, reading.values, reading.counters))
        if repeats:
            self._repeats += 1
            if self._repeats == LONG:
                self._share_times()
        elif self._repeats:
            self._end_sharing()
        unstamped = UNSTAMPED if clock.simulated and sent is None else 0.0
        for group in self._groups:
            stamps = group.stamps
            # Simulated time has one clock.
            found = stamps.believe(
                stamp, arrival, sent, FeedbackClock.stamp if clock.simulated else None
            )
            if found is None:
                continue
            time, doubt = found
            if doubt or stamps.late:
                for part in group.parts:
                    if part.axis.running:
                        self._doubt(part, stamps, bool(doubt), stop)
            open_for = doubt or unstamped * self.inputs[0].axis.period
            for switches in group.in_step:
                switches.repeat(time, arrival, open_for)
            for part in () if group.in_step else group.parts:
                axis = part.axis
                if repeats and not part.is_feedback:
                    axis.repeat(part.switches, time, arrival, open_for)
                    continue
                for number in part.numbers:
                    one = self._read[number]
                    if not (kept and self._is_known(one, reading.values[number])):
                        self._say(one, number, reading, time, arrival, open_for)
        return True

    def _watch_publisher(self, info: Info) -> None:
        """Notice that another publisher sends the feedback: its messages count from 1 again."""
        number = info.get('publication_sequence_number', 0)
        if number + REORDERED_MESSAGES < self._number and self.publishers < 2:
            for one in self._read:
                if one.is_feedback:
                    one.axis.feedback_source_changed()
        self._number = number

    def _is_known(self, one: WiredInput, value: Said) -> bool:
        """Return whether a kept message says nothing new: an old latch, or a level as known."""
        if one.source in LATCHES and one.written.counter is None:
            return True
        if not one.is_switch or not isinstance(value, int | float):
            return False
        if one.axis.readings.signal(Input(one.source)) is not (value >= 0.5):
            return False
        one.heard, one.missing = True, ''
        return True

    def _doubt(
        self,
        part: '_Part',
        stamps: Stamps,
        doubted: bool,
        stop: Callable[[Axis, Error, str], None],
    ) -> None:
        """Stop or warn an axis for a time that is doubted; latches and the servo need none."""
        for one in map(self._read.__getitem__, part.numbers):
            if not (one.is_switch or one.is_feedback):
                continue
            if stamps.late:
                error = Error.FeedbackStale if one.is_feedback else Error.SwitchStale
                stop(part.axis, error, too_late(one.name, stamps))
            if doubted:
                part.axis.warn(f'{one.name}: {stamps.warning}')

    def _say(
        self,
        one: WiredInput,
        number: int,
        reading: Reading,
        time: float,
        arrival: float,
        doubt: float,
    ) -> None:
        """Give the value of an input to its axis."""
        value, counter = reading.values[number], reading.counters[number]
        if value is NOT_MINE or counter is NOT_MINE:
            return
        if counter is not None:
            if isinstance(counter, Missing):
                self._lose(one, f'its counter: {counter.text}')
                return
            before, one.counter = one.counter, counter
            if before in (None, counter):  # not a new latch
                one.heard, one.missing = True, ''
                return
        if isinstance(value, Missing):
            self._lose(one, value.text, value.unread)
            return
        one.heard, one.missing = True, ''
        axis = one.axis
        if one.is_feedback:
            axis.feedback(time, float(value), arrival, doubt)
        elif one.is_temperature:
            axis.temperature = float(value)
        elif one.source in LATCHES:
            axis.latch(Input(one.source), float(value))
        elif one.source == Input.SERVO_ENABLED:
            axis.enable(value >= 0.5)
        else:
            axis.switch(Input(one.source), time, value >= 0.5, arrival, doubt)

    def _lose(self, one: WiredInput, why: str, unread: bool = False) -> None:
        """Note that a message does not say an input; end a run that needs it.

        A feedback that is no number is left out, and so are other joints, which other publishers
        of the topic send: the age of the feedback ends a run.
        """
        one.lose(why)
        if one.is_temperature:
            one.axis.temperature = None
            return
        if not one.axis.running or (one.is_feedback and (unread or self.publishers > 1)):
            return
        error = Error.FeedbackStale if one.is_feedback else Error.SwitchUnknown
        one.axis.stop(error, f'{one.name}: {why}')


@dataclass(frozen=True)
class _Part:
    """The inputs of one axis that judge stamps alike, by their places in the reader.

    ``switches`` are those of them that have levels.
    """

    axis: Axis
    numbers: list[int]
    switches: list[Input]
    is_feedback: bool


@dataclass
class _Group:
    """Axes that judge stamps alike; ``in_step``: their switches while these share their times."""

    stamps: Stamps
    parts: list[_Part]
    in_step: list[InStep] = field(default_factory=list)


def _may_repeat(one: WiredInput, value: Said, counter: Said | None) -> bool:
    """Return whether a message that says the same again says nothing new of an input."""
    if one.source in LATCHES:  # without a counter each message is a latch
        return isinstance(counter, int | float)
    return isinstance(value, int | float)


def _nothing() -> None:
    """Stand for a subscription that is not there yet."""
