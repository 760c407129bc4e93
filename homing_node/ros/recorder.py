# SPDX-License-Identifier: Apache-2.0
"""Records every run: the cycle notes, a thread of its own writes.

What cannot be written is one warning; no run fails and no cycle waits for it. ``lock`` guards the
axes and the taps.
"""

import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from ..core.axis import Axis, Setpoint
from ..memory.folder import folder_path
from ..parameters import yaml_file
from ..recording.cycles import Cycles
from ..recording.folder import CUT, RecordFolder
from ..recording.tap import LONGEST_WAIT, State, Tap
from ..version import version
from .configured_node import ConfiguredNode
from .record_messages import RecordMessages
from .timebase import TimeBase

try:
    from ..recording.run_file import About, RunFile, mirrored
except ImportError as error:  # mcap is on PyPI only
    MISSING = str(error)
else:
    MISSING = ''

#: How often what was noted is written, s: so much is missing after a `kill -9`. Each time costs
#: about 1 ms for each axis that homes, whatever there is to write.
WRITE_PERIOD = 2.0
#: Runs that have ended and wait for the disk; more are not recorded.
MOST_ENDED = 8
#: The node waits so long for the disk when it ends, s.
FAREWELL = 2.0

#: Returns what a record tells of a run: names and values, and the parameters as a file.
Describe = Callable[[Axis], tuple[Mapping[str, str], str]]


class Writing:
    """A run that is recorded: what was noted, and the file that it goes to."""

    def __init__(self, tap: Tap, offset: int) -> None:
        self.tap, self.offset = tap, offset
        self.begun = time.time_ns()  # not of a simulated clock, which begins anew each time
        self.path: Path | None = None
        self.raw: BinaryIO | None = None
        self.file: RunFile | None = None
        self.failed = False


class Recorder:
    """The records of all axes of the node.

    Attributes:
        open: The runs that are on, by axis; the cycle is noted while there are any.
        folder: Where the records are; None: nothing is recorded.
    """

    def __init__(
        self,
        node: str,
        joints: Mapping[str, str],
        feedback: str,
        ahead: float,
        folder: RecordFolder | None,
        timebase: TimeBase,
        describe: Describe,
        lock: threading.Lock,
        logger: Any,
    ) -> None:
        """Keep what a record needs.

        Args:
            node: The full name of the node.
            joints: The joint of each drive.
            feedback: The full name of the topic of the joint states.
            ahead: How long after its cycle an axis shall be at its setpoint, s.
            folder: Where the records are; None: nothing is recorded.
            timebase: The clock of the node.
            describe: Returns what a record tells of a run of an axis.
            lock: What guards the axes.
            logger: The logger of the node.
        """
        self._node, self._joints, self._feedback, self._ahead = node, joints, feedback, ahead
        self.folder, self._timebase, self._describe = folder, timebase, describe
        self._lock, self._logger = lock, logger
        self._messages = RecordMessages()
        self._wake = threading.Event()
        self._writings: list[Writing] = []  # the thread of the recorder takes off what is done
        self._runs: dict[str, int] = {}  # by axis: the runs that have ended, and are known
        self._told = ''  # the warning that was logged last, as long as it is true
        self._skipped = 0  # runs that are not recorded because too many wait
        self.open: dict[str, Tap] = {}
        self._noted = self._most = 0  # how many cycles wait to be written, and may wait
        self._turn = 0
        self._arrange()
        if folder is not None and MISSING:
            self.folder = None
            logger.warning(f'runs are not recorded: {MISSING}; pip install mcap (record)')

    # -------------------------------------------------------------- what happens; the lock is held

    def state(self, axis: Axis, stamp: int, report: State) -> bool:
        """Note a state that is published; a run begins and ends with one.

        Args:
            axis: The axis.
            stamp: The stamp of the state, ns.
            report: The state.

        Returns:
            Whether it is of a run, and will be written.
        """
        if self.folder is None:
            return False
        tap, runs = self.open.get(axis.name), axis.history.count
        if tap is None:
            before = self._runs.setdefault(axis.name, 0)
            if not axis.moving and runs == before:
                return False
            tap = self._begin(axis, min(runs, before))
        tap.state(stamp, report)
        if not (axis.handing_over or (axis.running and runs == tap.runs)):
            self._end(tap)
            if axis.running:  # the next run has begun already
                self._begin(axis, runs).state(stamp, report)
        return True

    def cycle(self, now: float, setpoints: Mapping[str, Setpoint]) -> None:
        """Note a cycle of the runs that are on."""
        taps = self._taps
        if self._noted < self._most:
            self._noted += 1
            self._cycles.note(now, setpoints)
        else:
            for tap in taps:
                tap.lost += 1
        for one in self._watched:
            if one.switch.seen != one.seen:
                one.seen = one.switch.seen
                one.tap.heard(one.switch)
        for tap in self._looking:
            tap.look(now)
        self._turn += 1
        gathers = self._gathers
        gathers[self._turn % len(gathers)].gather()

    def _begin(self, axis: Axis, runs: int) -> Tap:
        tap = self.open[axis.name] = Tap(axis, self._timebase.now, runs)
        self._most = int(LONGEST_WAIT / axis.period)
        self._arrange()
        ended = sum(bool(one.tap.ended) for one in self._writings)
        if ended < MOST_ENDED:
            self._writings.append(Writing(tap, self._timebase.offset))
            self._wake.set()
        else:
            self._skipped += 1
        return tap

    def _end(self, tap: Tap) -> None:
        axis = tap.axis
        outcome = axis.ended
        well = 'Homed' if outcome.verified is None else 'Verified'
        well = 'Jogged' if outcome.jogged else well
        tap.end(well if outcome.success else str(outcome.error))
        self._runs[axis.name] = axis.history.count
        del self.open[axis.name]
        self._arrange()
        self._wake.set()

    def _arrange(self) -> None:
        """Arrange what a cycle looks at: the runs that are on are others now."""
        self._taps = list(self.open.values())
        self._gathers = [drive for tap in self._taps for drive in tap.drives]
        self._watched = [one for drive in self._gathers for one in drive.switches]
        self._looking = [drive for drive in self._gathers if drive.looks]
        self._begin_cycles()

    def _begin_cycles(self) -> None:
        """Begin to note cycles anew, for the runs that are on."""
        self._cycles = Cycles([drive.name for drive in self._gathers])
        for tap in self._taps:
            tap.cycles.append(self._cycles)

    # --------------------------------------------------------------------------------- the thread

    def start(self, ended: Callable[[], bool]) -> None:
        """Start the thread; it ends some time after ``ended`` returns true."""
        self._thread = threading.Thread(
            target=self._run, args=(ended,), name='recorder', daemon=True
        )
        self._thread.start()

    def join(self) -> None:
        """Wait until all is written, but not for a disk that hangs."""
        self._wake.set()
        self._thread.join(FAREWELL)

    def _run(self, ended: Callable[[], bool]) -> None:
        if self.folder is None:
            return
        self._trying(self.folder.tidy)
        while not ended():
            if self._wake.wait(WRITE_PERIOD):
                self._wake.clear()
            self._write()
        with self._lock:
            for tap in self.open.values():
                tap.end(CUT)
        self._write()

    def _write(self) -> None:
        """Write what was noted since the last time."""
        with self._lock:
            self._noted = 0
            together = [(one, one.tap.take()) for one in self._writings]
            self._begin_cycles()
        for one, taken in together:
            if not one.failed and not self._trying(partial(self._save, one, taken)):
                one.failed = True
                self._give_up(one)
            if taken.ended:
                with self._lock:
                    self._writings.remove(one)
            time.sleep(0.0)  # the cycle may want to go on
        if self._skipped:
            skipped, self._skipped = self._skipped, 0
            self._logger.warning(f'the disk is slow: {skipped} runs are not recorded (record)')

    def _save(self, one: Writing, taken: Any) -> None:
        assert self.folder is not None
        tap = one.tap
        axis = tap.axis
        if one.file is None:
            values, parameters = self._describe(axis)
            about = About(
                self._node,
                axis.name,
                {drive.name: self._joints[drive.name] for drive in tap.drives},
                self._feedback,
                self._ahead,
                one.offset,
                values,
                parameters,
            )
            one.path, one.raw = self.folder.begin(axis.name, one.begun)
            one.file = RunFile(one.raw, about, tap.begun, self._messages)
        one.file.write(taken)
        if not taken.ended:
            return
        one.file.finish({'ended': tap.ended, 'lost': str(tap.lost)})
        assert one.path is not None
        self.folder.end(one.path, tap.ended)
        if tap.lost:
            self._logger.warning(
                f'axis {axis.name}: the disk is slow: {tap.lost} cycles and messages are not in '
                f'the record of the run (record)'
            )

    def _give_up(self, one: Writing) -> None:
        """Leave the record of a run as it is."""
        if self.folder is None or one.path is None or one.raw is None:
            return
        with suppress(OSError):
            one.raw.close()
        with suppress(OSError):
            self.folder.end(one.path, CUT)

    def _trying(self, action: Callable[[], object]) -> bool:
        """Return whether something could be written; if not, say it once."""
        try:
            action()
        except OSError as error:
            where = self.folder and self.folder.path
            self._warn(f'runs are not recorded: {where}: {error.strerror or error} (record)')
            return False
        except Exception as error:  # it must not end the node
            self._warn(f'the recorder broke: {error!r}')
            return False
        self._told = ''
        return True

    def _warn(self, text: str) -> None:
        if text != self._told:
            self._told = text
            self._logger.warning(text)


def recorder_of(
    node: ConfiguredNode, axes: Mapping[str, Axis], timebase: TimeBase, lock: threading.Lock
) -> Recorder:
    """Return the recorder of a node, as its parameters say; ``lock`` guards the axes."""
    checked, name = node.configuration, node.get_fully_qualified_name()
    path = folder_path(checked.record, name, os.environ)
    folder = path and RecordFolder(path, name, checked.record_runs, checked.record_failures)

    def describe(axis: Axis) -> tuple[dict[str, str], str]:
        p = axis.parameters
        values = {
            'version': version(),
            'node': name,
            'axis': axis.name,
            'joint': p.joint or axis.name,
            'unit': str(p.unit),
            'home_type': str(p.home_type),
            'kind': str(axis.kind),
            **mirrored(p, checked.followers.get(axis.name, {})),
        }
        return values, yaml_file.written(name, node.values_of(axis.name))

    return Recorder(
        name,
        checked.joints,
        node.resolve_topic_name('joint_states'),
        checked.lead + 1.0 / checked.update_rate,
        folder or None,
        timebase,
        describe,
        lock,
        node.get_logger(),
    )
