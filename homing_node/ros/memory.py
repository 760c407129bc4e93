# SPDX-License-Identifier: Apache-2.0
"""Keeps what the runs have found in files, and takes homes over from them after a restart.

A thread of its own writes: neither the cycle nor an answer waits for a disk. What cannot be
written is a warning. ``lock`` guards the axes and their keepers.
"""

import os
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ..core.axis import Axis
from ..core.kept_home import Ended
from ..core.outcome import Outcome
from ..memory.expected import expected_duration
from ..memory.fingerprint import configuration_hash
from ..memory.folder import Folder, FolderInUse, folder_path, this_boot, this_machine
from ..memory.keeper import Keeper
from ..memory.restoring import Refused, Restored
from ..memory.store import Contents, Store
from ..parameters.axis import AxisParameters
from ..parameters.definition import InvalidParameters
from ..parameters.node_fields import MEMORY_FOLDER
from ..procedures.states import Error, Restore
from . import messages

#: How often it is looked whether something is to be written, s.
WRITE_PERIOD = 0.1
#: How often it is looked whether a home can be taken over, and how long after the first feedback
#: a refusal stands: by then the graph is known. In s.
LOOK_PERIOD, SETTLED = 0.2, 2.0
#: How often the place of an axis is written that others move, if its home is to be restored, s.
PLACE_PERIOD = 60.0


class Memories:
    """The memory of all axes of the node."""

    def __init__(
        self,
        node: Node,
        axes: Mapping[str, Axis],
        value: str,
        topics_of: Callable[[str], Mapping[str, str]],
        feedback_topic_of: Callable[[str], str],
        lock: threading.Lock,
        group: CallbackGroup,
    ) -> None:
        """Read what was kept.

        Args:
            node: The node.
            axes: The axes, by name.
            value: The parameter `memory`.
            topics_of: Returns the sources that the parameters of an axis name.
            feedback_topic_of: Returns the full name of the topic of an axis's feedback.
            lock: What guards the axes.
            group: The callback group of the timer.

        Raises:
            InvalidParameters: Another node has the folder.
        """
        self._node, self._axes, self._topics_of = node, axes, topics_of
        self._feedback_topic_of, self._lock = feedback_topic_of, lock
        self._logger = node.get_logger()
        self._folder = self._open(value)
        self._failed: dict[str, str] = {}  # what could not be written, by axis
        self._stores: dict[str, Store] = {}
        self.keepers: dict[str, Keeper] = {}
        boot = this_boot()
        for name, axis in axes.items():
            keeper = Keeper(axis, self._hash(name), self._read(name), boot, time.time)
            axis.judge = partial(self._judge, keeper)
            self.keepers[name] = keeper
        self._last: dict[str, tuple[bool, bool]] = {}  # what was written of each axis
        self._open_ends = set(axes)  # it is not decided yet whether their homes are restored
        self._heard: dict[str, float] = {}  # when the feedback of each axis was heard first
        self._placed = time.monotonic()
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(
            LOOK_PERIOD, self._restore, callback_group=group, clock=clock
        )

    # ---------------------------------------------------------------------------------- the files

    def _open(self, value: str) -> Folder | None:
        """Take the folder, None if nothing is kept."""
        name = self._node.get_fully_qualified_name()
        path = folder_path(value, name, os.environ)
        if path is None:
            return None
        try:
            folder = Folder(path, name)
        except FolderInUse as error:
            if value != MEMORY_FOLDER:
                raise InvalidParameters(
                    [f'memory: {error}; give each node a folder of its own']
                ) from None
            self._logger.warning(f'nothing is kept of the runs: {error} (memory)')
            return None
        if folder.warning:
            self._logger.warning(f'nothing can be kept of the runs: {folder.warning} (memory)')
        return folder

    def _read(self, name: str) -> Contents:
        """Read the file of an axis; one of another machine is kept aside."""
        if self._folder is None:
            return Contents()
        store = self._stores[name] = self._folder.store(name, this_machine())
        try:
            contents = store.load()
        except OSError as error:
            self._logger.warning(f'axis {name}: {store.path}: {error.strerror} (memory)')
            return Contents()
        if contents.foreign:
            self._logger.warning(f'axis {name}: {store.path}: {contents.foreign}; kept aside')
            try:
                store.set_aside()
            except OSError as error:
                self._logger.warning(f'axis {name}: {store.path}: {error.strerror} (memory)')
                del self._stores[name]
        elif not contents.whole:
            self._logger.warning(f'axis {name}: {store.path}: lines are broken, and left out')
        return contents

    def _hash(self, name: str) -> str:
        axis = self._axes[name]
        joint = axis.parameters.joint or name
        return configuration_hash(axis.parameters, joint, self._topics_of(name))

    # --------------------------------------------------------------------------------- the thread

    def run(self, ended: Callable[[], bool]) -> None:
        """Write until the node has ended, then once more: it has ended in order."""
        while not ended():
            try:
                self._write(self._due())
            except Exception as error:  # it must not end the node
                self._logger.error(f'the memory broke: {error!r}')
            time.sleep(WRITE_PERIOD)
        with self._lock:
            for keeper in self.keepers.values():
                keeper.ended = True
        self._write(list(self._stores))
        if self._folder is not None:
            self._folder.release()

    def _due(self) -> list[str]:
        """Return the axes of which something is to be written."""
        now = time.monotonic()
        with self._lock:
            if now - self._placed > PLACE_PERIOD:
                self._placed = now
                for axis, keeper in zip(self._axes.values(), self.keepers.values(), strict=True):
                    restores = axis.parameters.restore is not Restore.never
                    keeper.dirty |= restores and axis.homed and keeper.displaced
            for name, axis in self._axes.items():
                state = axis.running, axis.homed
                if state != self._last.setdefault(name, (False, False)):
                    self._last[name] = state
                    self.keepers[name].dirty = True
            return [name for name in self._stores if self.keepers[name].dirty]

    def _write(self, names: list[str]) -> None:
        for name in names:
            keeper, store = self.keepers[name], self._stores[name]
            with self._lock:
                snapshot = keeper.snapshot()
            if snapshot.changed is not None:
                store.forget(snapshot.changed)
            try:
                store.save(snapshot.rest, snapshot.runs)
                failed = ''
            except OSError as error:
                failed = f'nothing can be kept of the runs: {store.path}: {error.strerror}'
            if failed and failed != self._failed.get(name):
                self._logger.warning(f'axis {name}: {failed} (memory)')
            self._failed[name] = failed
            told, trends = keeper.trends, keeper.memory.trends()
            with self._lock:
                keeper.trends = trends
                self._note(name)
            for text in trends:
                if text not in told:
                    self._logger.warning(f'axis {name}: {text}')

    def _note(self, name: str) -> None:
        """Tell the axis what stands in its diagnostics; the lock is held."""
        keeper = self.keepers[name]
        refusal = f'home not restored: {keeper.refusal}' if keeper.refusal else ''
        homed = self._axes[name].homed
        notes = ('' if homed else refusal, *keeper.trends, self._failed.get(name, ''))
        self._axes[name].notes = tuple(filter(None, notes))

    # ------------------------------------------------------------------------------- what happens

    def look(self) -> None:
        """Note who publishes the feedback; the lock is held."""
        publishers: dict[str, str] = {}
        for name, keeper in self.keepers.items():
            topic = self._feedback_topic_of(name)
            if topic not in publishers:
                publishers[topic] = '; '.join(
                    sorted(
                        f'{one.node_namespace.rstrip("/")}/{one.node_name} '
                        f'{bytes(one.endpoint_gid).hex()}'
                        for one in self._node.get_publishers_info_by_topic(topic)
                    )
                )
            keeper.look(publishers[topic])

    def configure(self, name: str, parameters: AxisParameters) -> None:
        """Use new parameters of an axis; the lock is held."""
        self.keepers[name].configure(parameters, self._hash(name))

    def expected(self, name: str) -> float:
        """Return how long a run of an axis takes, s; NaN if not known. The lock is held."""
        p = self._axes[name].parameters
        runs = self.keepers[name].memory.runs
        return expected_duration(runs, p.homing_velocity_fast, p.homing_velocity_slow)

    def accept(self, axis: Axis) -> str:
        """Accept the home that an axis has found last; the lock is held.

        Returns:
            What became of it; '' if there is none.
        """
        accepted = axis.accept()
        if accepted is None and not axis.homed:
            return ''
        run = self.keepers[axis.name].accept()
        found = axis.outcome
        home = f'{messages.place(found.home_position_raw, found.uncertainty)} {found.unit}'
        begins = '' if run is None else '; a new baseline begins with it'
        return f'accepted: home_position_raw={home}{begins}'

    def _judge(self, keeper: Keeper, ended: Ended) -> Outcome:
        """Judge a run; a fault in here must not fail a homing."""
        try:
            return keeper.judge(ended)
        except Exception as error:
            self._logger.error(f'axis {keeper.axis.name}: the run was not compared: {error!r}')
            return ended.outcome

    def _restore(self) -> None:
        """Take homes over, as soon as the feedback and its publisher are known."""
        now = time.monotonic()
        decided: dict[str, Restored | Refused | None] = {}
        with self._lock:
            heard = [name for name in self._open_ends if self._axes[name].readings.known]
            if heard:
                self.look()
            for name in heard:
                final = now - self._heard.setdefault(name, now) > SETTLED
                decided[name] = self._decide(name, self.keepers[name], final)
                if final or decided[name] is not None:
                    self._open_ends.discard(name)
        for name, found in decided.items():
            if isinstance(found, Restored):
                unit, unsure = self._axes[name].parameters.unit, found.uncertainty
                self._logger.warning(
                    f'axis {name}: home restored from before the restart: home_position_raw='
                    f'{messages.place(found.home, unsure)} {unit} ± {unit.length(unsure)} '
                    f'home_offset={messages.place(found.offset, unsure)} {unit}; verify it'
                )
            elif found is not None and found.text:
                self._logger.warning(f'axis {name}: home not restored: {found.text}')
        if not self._open_ends:
            self._timer.cancel()

    def _decide(self, name: str, keeper: Keeper, final: bool) -> Restored | Refused | None:
        """Decide on the home of one axis, and let it know where its switch was."""
        axis = self._axes[name]
        if axis.running or axis.history.runs:
            return None
        if axis.parameters.restore is Restore.never:
            if axis.remembered is None:
                keeper.recall()
            return None
        found = keeper.restore(final)
        if isinstance(found, Refused):
            keeper.recall()
            if found.text:
                text = f'home not restored: {found.text}'
                axis.outcome = Outcome(Error.NoError, text)
        if found is not None:
            keeper.dirty = True
            self._note(name)
        return found
