# SPDX-License-Identifier: Apache-2.0
"""Checks the sources of inputs: topics that nothing reads, latches, bits of two inputs."""

from collections.abc import Iterator
from itertools import combinations

from ..parameters.configuration import Configuration
from ..parameters.connections import FEEDBACK, TEMPERATURE, Connections
from ..procedures.states import LATCHES
from .finding import Finding, Severity


class ConnectedInputs:
    """The findings about the connections of all axes; an expression that cannot be parsed is none.

    Such an expression is a bad parameter, and the types of topics are only known in a graph:
    `homing doctor` and the node check what fits them.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration

    def check(self) -> Iterator[Finding]:
        """Yield the findings of all axes."""
        for axis, connections in self._configuration.connections.items():
            switches = self._configuration.drives[axis].switches
            yield from self._unread(axis, connections, switches)
            yield from self._latches(axis, connections, switches)
            yield from self._bits(axis, connections, switches)

    def _unread(
        self, axis: str, connections: Connections, switches: tuple[str, ...]
    ) -> Iterator[Finding]:
        """Find topics and types of inputs that are not in ``switches``."""
        for kind, values in (('topics', connections.sources), ('types', connections.types)):
            for name, value in values.items():
                if name not in (*switches, FEEDBACK, TEMPERATURE):
                    yield Finding(
                        Severity.warning,
                        axis,
                        'topic-unread',
                        f'{kind}.{name} is {value}, but {name} is not in switches',
                        'nothing reads it',
                        'switches',
                        None,
                        f'with {name}',
                    )

    def _latches(
        self, axis: str, connections: Connections, switches: tuple[str, ...]
    ) -> Iterator[Finding]:
        """Find latches whose every message is taken for a new one."""
        for name in LATCHES:
            source = connections.sources.get(name)
            if name not in switches or source is None or not source.expression:
                continue
            if source.counter is None:
                yield Finding(
                    Severity.warning,
                    axis,
                    'latch-without-counter',
                    f'topics.{name} is {source}, without a counter',
                    'each message counts as a new latch: a driver that repeats the last one gives '
                    'a place of the last run',
                    f'topics.{name}',
                    str(source),
                    f'{source} @ what changes with each latch',
                )

    def _bits(
        self, axis: str, connections: Connections, switches: tuple[str, ...]
    ) -> Iterator[Finding]:
        """Find inputs that read one word, and the same bit of it besides others."""
        words = [
            (name, source, source.value)
            for name, source in connections.sources.items()
            if name in switches and source.value is not None and source.value.equals is None
        ]
        for (one, source, value), (other, second, more) in combinations(words, 2):
            if (source.topic, value.place) != (second.topic, more.place):
                continue
            if value.mask == more.mask:
                continue  # one signal: what that means for a home type, shared_inputs.py tells
            if value.mask is None or more.mask is None or value.mask & more.mask:
                yield Finding(
                    Severity.warning,
                    axis,
                    'bits-shared',
                    f'{one} ({source}) and {other} ({second}) read the same bit',
                    'one is on whenever the other is',
                    f'topics.{other}',
                    str(second),
                    'a bit of its own for each',
                )
