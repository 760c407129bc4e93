# SPDX-License-Identifier: Apache-2.0
"""What is kept of an axis: whose file it is, where it rests, and each of its runs.

Positions are raw, m or rad; times are seconds of the system's clock. It may be set back: the
numbers of the runs give their order.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, TypeVar

#: The version of the file's format.
FORMAT = 1
#: The number of runs that are kept.
MOST_RUNS = 1000

Kept = TypeVar('Kept', bound='Head | Rest | Run')


@dataclass(frozen=True)
class Head:
    """Whose file it is.

    Attributes:
        axis: The name of the axis.
        machine: What tells this machine from any other.
        format: The version of the file's format.
    """

    axis: str
    machine: str
    format: int = FORMAT


@dataclass(frozen=True)
class Rest:
    """The axis as it was when the file was written.

    Attributes:
        position: Where it was, raw; None if no feedback was received.
        homed: Whether its home was known.
        home: Where home was, raw.
        offset: Raw position minus homed position.
        uncertainty: How far home may be off.
        moving: Whether a run was in progress: home was about to be replaced.
        ended: Whether the node had ended in order.
        configuration: The hash of everything that moves the origin.
        joint: The joint.
        encoder: The kind of encoder.
        turn: The travel of its turn, if it knows its place in a turn only; 0 if not.
        unit: The unit of the axis.
        publisher: Who published the feedback.
        boot: The boot of the host.
        time: When it was written, s.
    """

    position: float | None = None
    homed: bool = False
    home: float = 0.0
    offset: float = 0.0
    uncertainty: float = 0.0
    moving: bool = False
    ended: bool = False
    configuration: str = ''
    joint: str = ''
    encoder: str = ''
    turn: float = 0.0
    unit: str = 'm'
    publisher: str = ''
    boot: str = ''
    time: float = 0.0


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes:
        number: Its number; the first one is 1.
        time: When it ended, s.
        kind: What was asked for: `home`, `rehome` or `verify`.
        error: How it ended: the name of the error, or NoError.
        duration: How long it took, s.
        home: Where home was found, raw; None if it was not found.
        uncertainty: How far home may be off.
        resolution: The finest difference that the feedback can show.
        fast: The fast homing velocity, m/s or rad/s.
        slow: The slow one.
        frame: What says that two raw positions can be compared: equal frames.
        configuration: The hash of everything that moves the origin.
        quantities: What is compared from run to run, and its uncertainty, by name.
        pitch: The pitch of the index; 0: there is none, or it is not known.
        seen: Every edge and latch: (input, rises, way, position, uncertainty). Of a latch, rises
            is None.
        approach: Where the search for the switch ended, raw: where a quick run goes; None if no
            switch was searched.
        temperature: The temperature at its end, °C; None if it was not known.
        accepted: Whether the run began a new baseline, because the user has accepted its home.
    """

    number: int
    time: float
    kind: str
    error: str
    duration: float
    home: float | None = None
    uncertainty: float = 0.0
    resolution: float = 0.0
    fast: float = 0.0
    slow: float = 0.0
    frame: str = ''
    configuration: str = ''
    quantities: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    pitch: float = 0.0
    seen: tuple[tuple[str, bool | None, int, float, float], ...] = ()
    approach: float | None = None
    temperature: float | None = None
    accepted: bool = False

    def __post_init__(self) -> None:
        """Make lists tuples: JSON has only lists."""
        object.__setattr__(self, 'seen', tuple((*one,) for one in self.seen))
        pairs = {name: (*pair,) for name, pair in self.quantities.items()}
        object.__setattr__(self, 'quantities', pairs)

    def but_accepted(self) -> 'Run':
        """Return the run as the first one of a new baseline."""
        return replace(self, accepted=True, error='NoError')

    def but_moved(self) -> 'Run':
        """Return the run with the error that its home has moved."""
        return replace(self, error='HomeMoved')


KINDS: Mapping[str, type] = {'head': Head, 'rest': Rest, 'run': Run}


def as_mapping(record: Head | Rest | Run) -> dict[str, Any]:
    """Return a record as a mapping that JSON can hold."""
    return {type(record).__name__.lower(): asdict(record)}


def from_mapping(mapping: Mapping[str, Any]) -> Head | Rest | Run:
    """Return the record that a mapping holds; names that are not known are left out.

    Raises:
        ValueError: It holds none, or something is missing.
    """
    for kind, made in KINDS.items():
        values = mapping.get(kind)
        if isinstance(values, Mapping):
            known = {one.name for one in fields(made)}
            try:
                record: Head | Rest | Run = made(**{k: v for k, v in values.items() if k in known})
            except TypeError as error:
                raise ValueError(str(error)) from None
            return record
    raise ValueError(f'none of {", ".join(KINDS)} stands in {mapping!r}')
