"""The node's clock: the time of the core, how stamps relate to it, and waiting for the next cycle.

Without ``use_sim_time`` the core's time is the monotonic clock, and stamps (system time) are
related to it anew at every reading, so that a step of the system clock does no harm. With it the
core's time is ROS time.
"""

import ctypes
import time
from collections.abc import Callable

#: How often a simulated clock is looked at, s.
LOOK = 0.0005
#: A simulated clock that has not moved for this long of real time stands, s.
STANDSTILL = 1.0

#: A lead settles where this share of the setpoints is late. It changes by no more than LEAD_STEP
#: of the period a cycle, and stays below MOST_LEAD of it.
LATE_SHARE, LEAD_STEP, MOST_LEAD = 0.03, 3e-3, 0.8

#: prctl(2): how much later than asked a sleep of this thread may end, ns; 50 µs by default.
PR_SET_TIMERSLACK = 29


def wake_precisely() -> None:
    """Let the sleeps of the calling thread end when they should."""
    ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1)


class TimeBase:
    """The cycle reads it, nobody else: what lies between two readings is how late a cycle was.

    ``now`` is the time of the last reading, s; 0 while simulated time has not begun.
    ``ros_time`` returns the simulated time in ns, or is None where time is not simulated.
    """

    def __init__(self, ros_time: Callable[[], int] | None = None) -> None:
        self._ros_time = ros_time
        self._moved = time.monotonic()
        self._reading = 0.0, 0  # the time of the core in s, and the stamp at that time in ns
        self.read()

    @property
    def now(self) -> float:
        return self._reading[0]

    @property
    def simulated(self) -> bool:
        return self._ros_time is not None

    @property
    def stands(self) -> bool:
        """Whether simulated time has stood still for a while."""
        return self.simulated and time.monotonic() - self._moved > STANDSTILL

    @property
    def present(self) -> float:
        """The time, though no cycle has begun with it, s; for any thread."""
        return time.monotonic() if self._ros_time is None else self._ros_time() * 1e-9

    @property
    def elapsed(self) -> float:
        """How long ago the last reading was, s."""
        return self.present - self.now

    def read(self) -> float:
        """Read the clock; for the thread of the cycle alone."""
        if self._ros_time is None:
            reading = time.monotonic(), time.time_ns()
        else:
            wall = self._ros_time()
            reading = wall * 1e-9, wall
            if reading != self._reading:
                self._moved = time.monotonic()
        self._reading = reading
        return reading[0]

    def time_of(self, nanoseconds: int) -> float:
        """Return a stamp in the time of the core, by the last reading."""
        now, wall = self._reading
        return now + (nanoseconds - wall) * 1e-9

    def sleep_until(self, due: float, ended: Callable[[], bool]) -> None:
        """Wait for a time of the core.

        While time is simulated: or until ``ended`` says so, or until it was set back.
        """
        if self._ros_time is None:
            time.sleep(max(0.0, due - time.monotonic()))
            return
        before = self.now
        while before <= self.read() < due and not ended():
            time.sleep(LOOK)


class Lead:
    """How long before its setpoints are due a cycle begins, learned from which of them were late.

    ``time`` in s.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.time = 0.0

    def learn(self, late: bool) -> None:
        """Take whether the setpoints of a cycle were late."""
        time = self.time + (late - LATE_SHARE) * LEAD_STEP * self._period
        self.time = min(max(0.0, time), MOST_LEAD * self._period)
