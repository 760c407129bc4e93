# SPDX-License-Identifier: Apache-2.0
"""The record of runs that are followed from outside, by what a node says on its topics.

What comes before the first run is kept for a moment; from its begin on everything is written.
Times are in ns: those at which messages have arrived are of the clock of whoever listens, and
become those of the node's clock, which the stamps of its states tell.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import BinaryIO, NamedTuple

from .mcap_file import McapFile
from .run_file import ABOUT, AXIS_STATE, OUTCOME, STRING, Messages

#: What has come so long before a run is in its record, ns; and the newest of each topic.
BEFORE = 1_000_000_000


class Described(NamedTuple):
    """What a record tells of an axis.

    Attributes:
        axis: The axis.
        values: The version and the like, by name.
        parameters: The parameters of the axis, as a parameter file.
    """

    axis: str
    values: Mapping[str, str]
    parameters: str


class Said(NamedTuple):
    """What a state says of a run.

    Attributes:
        axis: The axis.
        stamp: When that was so, ns of the node's clock.
        idle: Whether no run is on.
        error: How the last run failed, or NoError.
    """

    axis: str
    stamp: int
    idle: bool
    error: str


class Heard(NamedTuple):
    """A message.

    Attributes:
        topic: Its topic.
        kind: The type of the topic, `package/msg/Name`.
        arrived: When it has arrived, ns.
        data: CDR.
        stamp: When it is of, ns of the node's clock; 0: when it has arrived.
    """

    topic: str
    kind: str
    arrived: int
    data: bytes
    stamp: int = 0


class HeardRuns:
    """The file of the runs of some axes of a node.

    Attributes:
        running: The axes whose run is on.
        ended: How the last run of each axis has ended that was on: an error, or NoError.
    """

    def __init__(
        self,
        file: BinaryIO,
        node: str,
        version: str,
        describe: Callable[[], Iterable[Described]],
        messages: Messages,
    ) -> None:
        """Wait for a run; nothing is written yet.

        Args:
            file: Where the record is written; the caller closes it.
            node: The full name of the node.
            version: The version of what writes it.
            describe: Returns what the record tells of each axis; called when a run begins.
            messages: What makes the bytes of messages.
        """
        self._raw, self._node, self._version = file, node, version
        self._describe, self._messages = describe, messages
        self._mcap: McapFile | None = None
        self._waiting: deque[Heard] = deque()
        self._newest: dict[str, Heard] = {}  # by topic, of what is too old to wait
        self._channels: dict[str, int] = {}
        self._axes: set[str] = set()  # whose states were heard
        self._ahead: int | None = None  # how much the node's clock is ahead of ours, ns
        self._earliest = 0  # nothing has an earlier time in the file, ns of the node's clock
        self.running: set[str] = set()
        self.ended: dict[str, str] = {}

    @property
    def begun(self) -> bool:
        """Whether a run has begun."""
        return self._mcap is not None

    @property
    def over(self) -> bool:
        """Whether all runs that have begun have ended."""
        return self.begun and not self.running

    def take(self, heard: Heard) -> None:
        """Take a message."""
        if self._mcap is not None:
            self._write(self._mcap, heard)
            return
        self._waiting.append(heard)
        while self._waiting[0].arrived < heard.arrived - BEFORE:
            old = self._waiting.popleft()
            self._newest[old.topic] = old

    def state(self, heard: Heard, said: Said) -> None:
        """Take a state, which may begin or end a run.

        The first of an axis may have waited for us for long, so that its age tells no clock.

        Raises:
            OSError: The file cannot be written.
        """
        if said.axis in self._axes and self._mcap is None:
            ahead = said.stamp - heard.arrived
            self._ahead = ahead if self._ahead is None else max(ahead, self._ahead)
        self._axes.add(said.axis)
        self.take(heard._replace(stamp=said.stamp))
        if not said.idle:
            self.running.add(said.axis)
            if self._mcap is None:
                self._begin(heard.arrived)
        elif said.axis in self.running:
            self.running.remove(said.axis)
            self.ended[said.axis] = said.error

    def flush(self) -> None:
        """Write what was taken since the last time.

        Raises:
            OSError: The file cannot be written.
        """
        if self._mcap is not None:
            self._mcap.flush()

    def finish(self, cut: str) -> None:
        """Write how the runs ended; the file is whole then.

        Args:
            cut: The word for a run that is still on.

        Raises:
            OSError: The file cannot be written.
        """
        if self._mcap is None:
            return
        ended = {**self.ended, **dict.fromkeys(self.running, cut)}
        several = len(ended) > 1
        text = ', '.join(f'{axis} {how}' if several else how for axis, how in ended.items())
        self._mcap.metadata(OUTCOME, {'ended': text})
        self._mcap.finish()

    # ------------------------------------------------------------------------------------- inside

    def _begin(self, now: int) -> None:
        """Begin the file with what has waited, in the order of its times."""
        self._ahead = self._ahead or 0
        self._earliest = now + self._ahead - BEFORE
        mcap = self._mcap = McapFile(self._raw, f'homing_node {self._version}')
        described = list(self._describe())
        for one in described:
            name = ABOUT if len(described) == 1 else f'{ABOUT}/{one.axis}'
            mcap.metadata(name, one.values)
        for one in described:
            topic = f'{self._node}/{one.axis}/parameters'
            text = self._messages.string(one.parameters)
            self._write(mcap, Heard(topic, STRING, now - BEFORE, text))
        for heard in (*self._newest.values(), *self._waiting):
            self._write(mcap, heard)
        self._newest.clear()
        self._waiting.clear()

    def _write(self, mcap: McapFile, heard: Heard) -> None:
        assert self._ahead is not None
        if heard.topic not in self._channels:
            text = self._messages.text(heard.kind)
            self._channels[heard.topic] = mcap.topic(heard.topic, heard.kind, text)
        arrived = heard.stamp if heard.kind == AXIS_STATE else heard.arrived + self._ahead
        logged = max(arrived, self._earliest, 0)
        published = max(heard.stamp, logged)
        mcap.add(self._channels[heard.topic], logged, published, heard.data)
