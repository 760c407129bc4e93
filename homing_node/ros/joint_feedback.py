# SPDX-License-Identifier: Apache-2.0
"""The feedback of the axes that read joint_states: by the names of their joints."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from math import isfinite

from ..core.axis import Axis
from ..core.position_array import OtherJoint
from ..core.stamps import REORDERED, Stamps, too_late
from ..procedures.states import Error, FeedbackClock
from .polling import Info
from .serialized import JointStateReader, PlainJointStateReader
from .stamp_groups import Judging, grouped
from .timebase import TimeBase

#: More lists of joints than publishers can have: the oldest one is forgotten.
MANY_LISTS = 100
#: Messages may come in another order than they were sent in, by up to this many.
REORDERED_MESSAGES = 10


class JointList:
    """The axes whose joints stand in one list of names, which one publisher sends.

    ``groups``: the axes with the same ``feedback_timeout`` and ``feedback_clock``, each with its
    place in the list; they judge a stamp alike. ``known``: the stamps that each axis last judged
    by. ``others``: joints that no axis homes, with their places. ``number``: the number of the
    newest message; a new publisher counts from the beginning.
    """

    number = 0

    def __init__(
        self,
        places: Sequence[tuple[int, Axis]],
        known: dict[Hashable, Stamps],
        others: Sequence[tuple[int, OtherJoint]] = (),
    ) -> None:
        self._places, self._known = places, known
        self.others = others
        self.groups: list[tuple[Stamps, list[tuple[int, Axis]]]] = []
        self.regroup()

    def regroup(self) -> None:
        """Follow changed parameters; what is known of the stamps stays."""
        self.groups = grouped(
            [
                (
                    axis.name,
                    Judging(
                        axis.parameters.feedback_timeout, axis.parameters.feedback_clock, REORDERED
                    ),
                    (place, axis),
                )
                for place, axis in self._places
            ],
            self._known,
        )


class JointFeedback:
    """Gives the positions in joint_states to the axes.

    Attributes:
        lists: the list of joints of each publisher, by the names.
        others: the joints that no axis homes and whose feedback is wanted, by name.
    """

    def __init__(self, serialized: bool) -> None:
        """Create it for no axis; ``serialized``: read messages from their bytes."""
        self.lists: dict[tuple[str, ...], JointList] = {}
        self.others: Mapping[str, OtherJoint] = {}
        self._by_joint: Mapping[str, Axis] = {}
        self._names: tuple[str, ...] = ()  # of the last message, and their list
        self._list = JointList([], {})
        self._stamps: dict[Hashable, Stamps] = {}  # of each axis, as last judged
        self._reader = JointStateReader() if serialized else PlainJointStateReader()

    def serve(self, by_joint: Mapping[str, Axis]) -> None:
        """Give positions to these axes, by their joints, and follow their parameters."""
        if by_joint != self._by_joint:
            self._by_joint = dict(by_joint)
            self.lists.clear()
            self._names, self._list = (), JointList([], {})
        for joints in self.lists.values():
            joints.regroup()

    def receive(
        self, data: bytes, info: Info, clock: TimeBase, stop: Callable[[Axis, Error, str], None]
    ) -> None:
        """Give a message to the axes; the arguments are those of `Feed.receive`."""
        read = self._reader.read(data)
        if read is None:
            return
        sampled, names, positions = read
        clock.relate()
        arrival = stamp = clock.polled
        sent: float | None = None  # without a header there is one time
        if not clock.simulated:
            arrival = min(arrival, clock.time_of(info['received_timestamp']))
            stamp = clock.time_of(info['source_timestamp'])
        if sampled:
            sent, stamp = stamp, clock.time_of(sampled)
        if names is not self._names:
            self._names, self._list = names, self._list_of(names)
        self._watch_publisher(self._list, info)
        known = len(positions)
        for place, joint in self._list.others:
            if place < known and isfinite(positions[place]):
                joint.feedback(positions[place], arrival)
        for stamps, places in self._list.groups:
            # Simulated time has one clock.
            found = stamps.believe(
                stamp, arrival, sent, FeedbackClock.stamp if clock.simulated else None
            )
            if found is None:
                continue
            time, doubt = found
            for place, axis in places:
                if stamps.late:
                    stop(axis, Error.FeedbackStale, too_late('joint_states', stamps))
                if place < known and isfinite(positions[place]):
                    axis.feedback(time, positions[place], arrival, doubt)
                    if doubt:
                        axis.warn(f'joint_states: {stamps.warning}')

    @staticmethod
    def _watch_publisher(joints: JointList, info: Info) -> None:
        """Notice that another publisher sends these joints: its messages count from 1 again."""
        number = info.get('publication_sequence_number', 0)
        if number + REORDERED_MESSAGES < joints.number:
            for _, places in joints.groups:
                for _, axis in places:
                    axis.feedback_source_changed()
        joints.number = number

    def _list_of(self, names: tuple[str, ...]) -> JointList:
        """Return the list of joints with these names, which may be new."""
        if names in self.lists:
            return self.lists[names]
        if len(self.lists) >= MANY_LISTS:
            del self.lists[next(iter(self.lists))]
        joints = self.lists[names] = JointList(
            [
                (place, self._by_joint[name])
                for place, name in enumerate(names)
                if name in self._by_joint
            ],
            self._stamps,
            [
                (place, self.others[name])
                for place, name in enumerate(names)
                if name in self.others
            ],
        )
        return joints
