# SPDX-License-Identifier: Apache-2.0
"""The node's clock: the time of the core, the time of stamps, and the wait for the next cycle.

Without ``use_sim_time`` the core's time is the monotonic clock, and stamps (system time) are
related to it anew at every message, so that a step of the system clock does no harm. With it the
core's time is ROS time.
"""

import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

#: Interval at which a simulated clock is read while the cycle waits, s.
READ_PERIOD = 0.0005
#: A simulated clock that has not moved for this long of real time stands still, s. A gap between
#: two readings counts as at most BLINK, as this process may have been delayed, and not the clock.
STANDSTILL, BLINK = 1.0, 0.1

#: A lead settles where this share of the setpoints is late. It changes by no more than LEAD_STEP
#: of the period a cycle, and stays below MOST_LEAD of it.
LATE_SHARE, LEAD_STEP, MOST_LEAD = 0.03, 3e-3, 0.8

#: Two clocks are read one after the other, and the process may be held up in between: they are
#: read this often, and the closest readings count.
READINGS = 3
#: Clocks are related to within this; a difference of more than the other means that one was set,
#: ns. Between them the stamps follow by this part of the time: the velocity at the drive changes
#: as much.
READING_ERROR, CLOCK_WAS_SET, SLEW = 20_000, 50_000_000, 1e-3
#: How much later than asked a sleep of the cycle may end, ns; 50000 by default.
TIMER_SLACK = 1


def wake_precisely() -> None:
    """Let the sleeps of the calling thread end when they should (Linux: proc(5))."""
    with suppress(OSError):  # another system, or not allowed
        Path(f'/proc/{threading.get_native_id()}/timerslack_ns').write_text(str(TIMER_SLACK))


class TimeBase:
    """The node's clock. Only the cycle calls `read`: the gap between two readings is its lateness.

    ``now`` is the time of the last reading, ``polled`` the time of the last poll or message, in s;
    both are 0 while simulated time has not begun. ``ros_time`` returns the simulated time in ns;
    None: time is not simulated.
    """

    def __init__(self, ros_time: Callable[[], int] | None = None) -> None:
        self._ros_time = ros_time
        self._stood, self._looked = 0.0, time.monotonic()  # s of real time
        self.now = 0.0
        self._relation = 0.0, 0  # the time of the core in s, and the stamp at that time in ns
        self.read()
        self.relate()

    @property
    def polled(self) -> float:
        return self._relation[0]

    @property
    def simulated(self) -> bool:
        return self._ros_time is not None

    @property
    def stands(self) -> bool:
        """Whether simulated time stands still."""
        return self.simulated and self._stood > STANDSTILL

    @property
    def elapsed(self) -> float:
        """The time since the last reading, s."""
        return self._look()[0] - self.now

    def read(self) -> float:
        """Read the clock; only the thread of the cycle may."""
        before = self.now
        self.now, _ = self._look()
        if self.simulated:
            looked, self._looked = self._looked, time.monotonic()
            self._stood = (
                self._stood + min(self._looked - looked, BLINK) if self.now == before else 0.0
            )
        return self.now

    def relate(self) -> None:
        """Measure again how system time relates to the core's time; while the axes are locked."""
        self._relation = self._look()

    @property
    def offset(self) -> int:
        """How much stamps are ahead of the time of the core, as they were related last, ns."""
        then, wall = self._relation
        return wall - round(then * 1e9)

    def time_of(self, nanoseconds: int) -> float:
        """Return a stamp in the time of the core, by the last `relate`."""
        then, wall = self._relation
        return then + (nanoseconds - wall) * 1e-9

    def sleep_until(self, due: float, ended: Callable[[], bool]) -> None:
        """Wait until a time of the core.

        In simulated time the wait also ends if ``ended`` returns true, or if time was set back.
        """
        if self._ros_time is None:
            time.sleep(max(0.0, due - time.monotonic()))
            return
        before = self.now
        while before <= self.read() < due and not ended():
            time.sleep(READ_PERIOD)

    def _look(self) -> tuple[float, int]:
        """Return the time of the core in s, and the stamp at that time in ns."""
        if self._ros_time is not None:
            wall = self._ros_time()
            return wall * 1e-9, wall
        closest = math.inf
        before = time.monotonic()
        for _ in range(READINGS):
            wall, after = time.time_ns(), time.monotonic()
            if after - before < closest:
                closest, relation = after - before, (after, wall)
            before = after
        return relation


class Stamps:
    """Gives the times of the core as stamps of ROS time, for setpoints.

    What lies between the two clocks is measured each time, but followed slowly: jitter of a
    reading would be jitter of the motion. Only a clock that was set is followed at once.
    """

    def __init__(self, timebase: TimeBase) -> None:
        self._timebase = timebase
        self._offset: int | None = None  # of ROS time to the time of the core, ns
        self._followed = 0.0  # when the offset was followed last, s

    def stamp_of(self, time: float) -> int:
        """Return the stamp of a time of the core, ns."""
        if self._timebase.simulated:
            return round(time * 1e9)
        offset = self._timebase.offset
        most = int(SLEW * max(0.0, time - self._followed) * 1e9)
        self._followed = time
        if self._offset is None or abs(offset - self._offset) > CLOCK_WAS_SET:
            self._offset = offset
        elif abs(offset - self._offset) > READING_ERROR:
            self._offset += max(-most, min(offset - self._offset, most))
        return round(time * 1e9) + self._offset


class Lead:
    """How long before its setpoints are due a cycle begins, learned from the late setpoints.

    ``time`` in s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.time = 0.0

    def learn(self, late: bool) -> None:
        """Adapt the lead; ``late``: the setpoints of this cycle left after they were due."""
        time = self.time + (late - LATE_SHARE) * LEAD_STEP * self._period
        self.time = min(max(0.0, time), MOST_LEAD * self._period)
