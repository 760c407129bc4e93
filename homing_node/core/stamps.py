# SPDX-License-Identifier: Apache-2.0
"""Which stamps can be believed. Times in s of the receiver's clock; no clock is read here.

A stamp in the future, too old, or running backwards is replaced by the arrival, and one whose
publisher's clock seems to be behind is corrected, so that two hosts whose clocks disagree give a
larger uncertainty, never a wrong home.
"""

import math

from ..procedures.states import FeedbackClock

#: How far a stamp may lie in the future: two synchronised clocks agree to this.
AGREEMENT = 1e-3
#: Even the quickest message of a publisher was on its way for longer: its clock is behind.
BEHIND = 0.04
#: How far a time may be wrong for which the arrival stands, s.
FALLBACK_DOUBT = 0.02
#: After a jump, stamps are believed again once their age is back within this of what it was.
RETURNED = 5e-3
#: A header further than this from the sending of even the promptest message may come from another
#: clock, s; further than LONGEST_SAMPLING it must.
OWN_CLOCK = 0.01
LONGEST_SAMPLING = 1.0
#: Samples of feedback in a row that may have overtaken each other.
REORDERED = 2


class Stamps:
    """The stamps of one publisher.

    ``limit`` is the largest believable age; ``clock`` which time of a message with a header is the
    sampling time; ``reorder`` how many stamps in a row may run
    backwards and are taken for messages that overtook each other (they are to be dropped).
    ``warning`` says why a stamp was not believed, '' while all are; ``replaced`` counts them;
    ``smallest`` is the smallest arrival - stamp, ``offset`` the smallest arrival - sending: how
    far the publisher's clock is behind, plus the shortest latency.
    ``late``: how late the last message was, where it was too late of a clock that was believed, s;
    its arrival is no time to home by. From then on that clock is taken for one that disagrees.
    ``lag``: the smallest sending - header stamp by size, inf before a message with a header.
    """

    __slots__ = (
        'limit',
        'clock',
        'reorder',
        'warning',
        'replaced',
        'smallest',
        'offset',
        'late',
        'lag',
        '_newest',
        '_backwards',
        '_jumped',
    )

    def __init__(self, limit: float, reorder: int = 0) -> None:
        self.limit = limit
        self.clock = FeedbackClock.auto
        self.reorder = reorder
        self.warning = ''
        self.replaced = 0
        self.smallest = self.offset = math.inf
        self.late = 0.0
        self.lag = math.inf
        self._newest = -math.inf
        self._backwards = 0
        self._jumped = False

    def believe(
        self,
        stamp: float,
        arrival: float,
        sent: float | None = None,
        clock: FeedbackClock | None = None,
    ) -> tuple[float, float] | None:
        """Return the time to use and how far it may be wrong (0: it is the stamp), s.

        A header that is far from the sending of its own message has two readings: the sampling
        took so long, or the header comes from another clock. The time is then between both, and
        the doubt covers both, unless ``clock`` settles it.

        Args:
            stamp: the time in the message's header; without a header the time of sending, s.
            arrival: when the message arrived, s.
            sent: when the middleware sent the message, s; None if it has no header.
            clock: which time is the sampling time, by default as ``self.clock`` says; only for a
                message with a header.

        Returns:
            Time and doubt; None if this message is to be dropped.
        """
        clock = clock or self.clock
        if sent is None or clock is FeedbackClock.stamp:
            return self._judge(stamp, arrival, sent)
        if clock is FeedbackClock.arrival:
            return self._judge(sent, arrival, sent)
        if abs(sent - stamp) < abs(self.lag):
            self.lag = sent - stamp
        if abs(self.lag) <= OWN_CLOCK:
            return self._judge(stamp, arrival, sent)
        judged = self._judge(sent, arrival, sent)
        if judged is None:
            return None
        time, doubt = judged
        side = 'behind' if self.lag > 0.0 else 'ahead of'
        self.warning = (
            f'header stamps are at least {abs(self.lag):.3f} s {side} the sending of their '
            'messages: another clock, or a slow sampling (feedback_clock settles it)'
        )
        self.replaced += 1
        if not 0.0 < self.lag <= LONGEST_SAMPLING:
            return time, doubt + FALLBACK_DOUBT
        half = 0.5 * self.lag
        return time - (sent - stamp - half), doubt + half

    def _judge(
        self, stamp: float, arrival: float, sent: float | None
    ) -> tuple[float, float] | None:
        """Return the time to use and its doubt, of a stamp by the sender's clock."""
        age = arrival - stamp
        self.late = 0.0
        if stamp < self._newest:
            self._backwards += 1
            if self._backwards <= self.reorder:
                return None
            self._jumped = True
        else:
            self._backwards = 0
        self._newest = stamp
        if self._jumped and -AGREEMENT <= age <= self.smallest + RETURNED:
            self._jumped = False
        if age < -AGREEMENT:
            self.warning = 'stamps in the future were replaced by the arrival'
        elif age > self.limit:
            self.warning = f'stamps older than {self.limit:g} s were replaced by the arrival'
            if not self._jumped and self.smallest < math.inf:
                self.late, self.smallest = age - self.smallest, math.inf
        elif self._jumped:
            self.warning = 'stamps that ran backwards were replaced by the arrival'
        else:
            self.warning = ''
            self.smallest = min(self.smallest, age)
            self.offset = min(self.offset, age if sent is None else arrival - sent)
            if self.offset <= BEHIND:
                return min(stamp, arrival), 0.0
            self.warning = (
                f'messages take at least {self.offset:.3f} s, by their stamps; '
                'that clock was taken to be behind'
            )
            self.replaced += 1
            return min(stamp + self.offset, arrival), self.offset
        self.replaced += 1
        return arrival, FALLBACK_DOUBT


def too_late(name: str, stamps: Stamps) -> str:
    """Tell that a message was too late."""
    return (
        f'a message of {name} came {stamps.late:.3f} s late, more than {stamps.limit:g} s '
        '(feedback_timeout)'
    )
