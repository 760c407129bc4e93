# SPDX-License-Identifier: Apache-2.0
"""Which stamps can be believed. Times in s of the receiver's clock; no clock is read here.

A stamp in the future, too old, or running backwards is replaced by the arrival, and one whose
publisher's clock seems to be behind is corrected, so that two hosts whose clocks disagree give a
larger uncertainty, never a wrong home.
"""

import math

#: How far a stamp may lie in the future: two synchronised clocks agree to this.
AGREEMENT = 1e-3
#: Even the quickest message of a publisher was on its way for longer: its clock is behind.
BEHIND = 0.04
#: How far a time may be wrong that is that of the arrival, s.
FALLBACK_DOUBT = 0.02
#: After a jump, stamps are believed again once their age is back within this of what it was.
RETURNED = 5e-3
#: Samples of feedback in a row that may have overtaken each other.
REORDERED = 2


class Stamps:
    """The stamps of one publisher.

    ``limit`` is the largest believable age; ``reorder`` how many stamps in a row may run
    backwards and are taken for messages that overtook each other (they are to be dropped).
    ``warning`` says why a stamp was not believed, '' while all are; ``replaced`` counts them;
    ``smallest`` is the smallest arrival - stamp, ``offset`` the smallest arrival - sending: how
    far the publisher's clock is behind, plus the shortest latency.
    ``late``: how late the last message was, where it was too late of a clock that was believed, s;
    its arrival is no time to home by. From then on that clock is taken for one that disagrees.
    """

    __slots__ = (
        'limit',
        'reorder',
        'warning',
        'replaced',
        'smallest',
        'offset',
        'late',
        '_newest',
        '_backwards',
        '_jumped',
    )

    def __init__(self, limit: float, reorder: int = 0) -> None:
        self.limit = limit
        self.reorder = reorder
        self.warning = ''
        self.replaced = 0
        self.smallest = self.offset = math.inf
        self.late = 0.0
        self._newest = -math.inf
        self._backwards = 0
        self._jumped = False

    def believe(
        self, stamp: float, arrival: float, sent: float | None = None
    ) -> tuple[float, float] | None:
        """Return the time to use and how far it may be wrong (0: it is the stamp), s.

        None: drop this message. ``sent`` is by the clock of the stamp, too; by default the stamp.
        """
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
