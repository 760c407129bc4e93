"""Which stamps can be believed. Times in s of the receiver's clock; no clock is read here.

A stamp in the future, too old, or running backwards is replaced by the arrival, so that two
hosts whose clocks disagree give a larger uncertainty, never a wrong home.
"""

import math

#: How far a stamp may lie in the future: two synchronised clocks agree to this.
AGREEMENT = 1e-3
#: After a jump, stamps are believed again once their age is back within this of what it was.
RETURNED = 5e-3


class Stamps:
    """The stamps of one publisher.

    ``limit`` is the largest believable age; ``reorder`` how many stamps in a row may run
    backwards and are taken for messages that overtook each other (they are to be dropped).
    ``warning`` says why a stamp was not believed, '' while all are; ``replaced`` counts them;
    ``smallest`` is the smallest arrival - stamp: the clock's offset plus the shortest latency.
    """

    __slots__ = ('limit', 'reorder', 'warning', 'replaced', 'smallest',
                 '_newest', '_backwards', '_jumped')

    def __init__(self, limit: float, reorder: int = 0) -> None:
        self.limit = limit
        self.reorder = reorder
        self.warning = ''
        self.replaced = 0
        self.smallest = math.inf
        self._newest = -math.inf
        self._backwards = 0
        self._jumped = False

    def believe(self, stamp: float, arrival: float) -> tuple[float, bool] | None:
        """Return the time to use and whether it is the stamp; None: drop this message."""
        age = arrival - stamp
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
            self.warning = f'a stamp lies {-age:.6f} s in the future'
        elif age > self.limit:
            self.warning = f'a stamp is {age:.3f} s old, more than {self.limit:g} s'
        elif self._jumped:
            self.warning = 'the stamps ran backwards'
        else:
            self.warning = ''
            self.smallest = min(self.smallest, age)
            return min(stamp, arrival), True
        self.replaced += 1
        return arrival, False
