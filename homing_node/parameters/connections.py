# SPDX-License-Identifier: Apache-2.0
"""What an axis is connected to: the source of each input, and where its outputs go.

The parameters ``topics.<input>``, ``types.<input>``, ``commands.<output>``, ``services.<output>``.
The language of a source is in `homing_node.language`; doc/inputs.md has it on one page.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..language.expression import BadExpression, Lookup, Source, parse
from ..procedures.states import LATCHES, Input, TextEnum
from .definition import Definition, read, table

#: A topic or a service: absolute, relative, or under the node's name (~/).
TOPIC_NAME = re.compile(r'(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')
TYPE_NAME = re.compile(r'(?P<package>[a-z][a-z0-9_]*)/(msg/)?(?P<name>[A-Z][A-Za-z0-9]*)')

#: What has a topic besides the inputs.
FEEDBACK = 'feedback'
TEMPERATURE = 'temperature'
#: Everything that is received of an axis; what it is called in `topics` and `types`.
RECEIVED: tuple[str, ...] = (*map(str, Input), FEEDBACK, TEMPERATURE)


class Output(TextEnum):
    """What the node tells a drive besides setpoints; the value is the topic's last part."""

    SERVO_ON = 'servo_on'
    TORQUE_LIMIT = 'torque_limit'
    ARM_LATCH = 'arm_latch'


@dataclass(frozen=True)
class Command:
    """An interface of a group, which messages on a topic command."""

    topic: str
    group: str
    interface: str

    def __str__(self) -> str:
        return f'{self.topic}#{Lookup(self.group, self.interface)}'


@dataclass(frozen=True)
class Calls:
    """The services that are called when an output changes; '' where there is none.

    Attributes:
        set: A SetBool service, called with the value.
        true: A Trigger service, called when the value becomes true.
        false: A Trigger service, called when the value becomes false.
    """

    set: str = ''
    true: str = ''
    false: str = ''


@dataclass(frozen=True)
class Connections:
    """What one axis is connected to.

    Attributes:
        sources: Where each input comes from; the others come from ~/<axis>/<input>, the feedback
            from joint_states.
        types: The message type of the topic of an input, where it is told.
        commands: The interface that follows each output.
        calls: The services that follow each output.
        no_torque_limit: What stands for no torque limit in a command, %.
    """

    sources: Mapping[str, Source] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    commands: Mapping[Output, Command] = field(default_factory=dict)
    calls: Mapping[Output, Calls] = field(default_factory=dict)
    no_torque_limit: float = 0.0

    def source(self, axis: str, name: str) -> Source:
        """Return where an input of an axis, or of a follower of a gantry, comes from."""
        return self.sources.get(name) or Source(f'~/{axis.replace(".", "/")}/{name}')


class SourceDefinition(Definition):
    """The definition of the source of an input; '' stands for the default."""

    def convert(self, value: object) -> Any:
        text = super().convert(value)
        if not text:
            return ''
        received = self.name.partition('.')[2]
        try:
            source = parse(text)
        except BadExpression as error:
            raise ValueError(f'{self.name}: {error}') from None
        self._check_topic(source.topic)
        if source.counter is not None and received not in LATCHES:
            raise ValueError(
                f"{self.name}: '@' and a counter are for {' and '.join(LATCHES)}, "
                f'{received} has no latches'
            )
        is_level = source.value is not None and source.value.is_level
        if is_level and (received in LATCHES or received == FEEDBACK):
            raise ValueError(f'{self.name}: {source.value} is on or off, {received} is a position')
        if is_level and received == TEMPERATURE:
            raise ValueError(f'{self.name}: {source.value} is on or off, {received} is a number')
        return text

    def _check_topic(self, topic: str) -> None:
        if not TOPIC_NAME.fullmatch(topic):
            raise ValueError(f'{self.name}: {topic!r} is not the name of a topic')


class TypeDefinition(Definition):
    """The definition of the name of a message type; '' stands for: found in the graph."""

    def convert(self, value: object) -> Any:
        text = super().convert(value)
        if text and not TYPE_NAME.fullmatch(text):
            raise ValueError(
                f'{self.name}: {text!r} is not the name of a message type, '
                'such as std_msgs/msg/Bool'
            )
        return text


class CommandDefinition(SourceDefinition):
    """The definition of what an output commands; '' stands for nothing."""

    def convert(self, value: object) -> Any:
        text = Definition.convert(self, value)
        if text:
            self.command(text)
        return text

    def command(self, text: str) -> Command:
        """Return the interface that a text names; raises ValueError."""
        try:
            source = parse(text)
        except BadExpression as error:
            raise ValueError(f'{self.name}: {error}') from None
        self._check_topic(source.topic)
        value = source.value
        if (
            source.counter
            or value is None
            or value.is_level
            or not isinstance(value.place, Lookup)
        ):
            raise ValueError(
                f"{self.name}: {text!r} is not a topic, '#' and group/interface, such as "
                "'/gpio_controller/commands#EL2008/d_output.1'"
            )
        return Command(source.topic, value.place.group, value.place.name)


class ServiceDefinition(SourceDefinition):
    """The definition of the name of a service; '' stands for none."""

    def convert(self, value: object) -> Any:
        text = Definition.convert(self, value)
        if text and not TOPIC_NAME.fullmatch(text):
            raise ValueError(f'{self.name}: {text!r} is not the name of a service')
        return text


TOPIC_DEFINITIONS: Mapping[str, Definition] = table(
    *(
        SourceDefinition(
            f'topic of {name} (empty: ~/<axis>/{name}), and what in its messages it is (#...)',
            str,
            name=f'topics.{name}',
            default='',
        )
        for name in Input
    ),
    SourceDefinition(
        'topic of the feedback (empty: joint_states), and what in its messages it is (#...)',
        str,
        name=f'topics.{FEEDBACK}',
        default='',
    ),
    SourceDefinition(
        'topic of the temperature, °C, that the memory keeps of each run (empty: none), and what '
        'in its messages it is (#...)',
        str,
        name=f'topics.{TEMPERATURE}',
        default='',
    ),
)
TYPE_DEFINITIONS: Mapping[str, Definition] = table(
    *(
        TypeDefinition(
            f'message type of the topic of {name} (empty: as its publisher says)',
            str,
            name=f'types.{name}',
            default='',
        )
        for name in RECEIVED
    )
)
COMMAND_DEFINITIONS: Mapping[str, Definition] = table(
    *(
        CommandDefinition(
            f'what follows {name}: topic#group/interface, of control_msgs/'
            'DynamicInterfaceGroupValues (empty: nothing)',
            str,
            name=f'commands.{name}',
            default='',
        )
        for name in Output
    ),
    Definition(
        'what commands.torque_limit is while there is no limit (the most that the drive has)',
        float,
        '%',
        0.0,
        1000.0,
        name='commands.no_torque_limit',
        default=0.0,
    ),
)
SERVICE_DEFINITIONS: Mapping[str, Definition] = table(
    *(
        ServiceDefinition(
            f'{kind} service that is called {when} (empty: none)',
            str,
            name=f'services.{name}{suffix}',
            default='',
        )
        for name in Output
        for suffix, kind, when in (
            ('', 'SetBool', f'with {name} when it changes'),
            ('_true', 'Trigger', f'when {name} becomes true'),
            ('_false', 'Trigger', f'when {name} becomes false'),
        )
    )
)
#: All parameters of connections.
CONNECTION_DEFINITIONS: Mapping[str, Definition] = {
    **TOPIC_DEFINITIONS,
    **TYPE_DEFINITIONS,
    **COMMAND_DEFINITIONS,
    **SERVICE_DEFINITIONS,
}


def connections(values: Mapping[str, object], axis: str = '') -> tuple[Connections, list[str]]:
    """Read the connections of an axis.

    Args:
        values: Parameters by their names behind the axis; those of other kinds are passed over.
        axis: What stands before each name in the messages.

    Returns:
        The connections, without what is wrong, and a message for each fault.
    """
    given = {name: value for name, value in values.items() if name in CONNECTION_DEFINITIONS}
    good, faults = read(given, CONNECTION_DEFINITIONS)
    sources = {name: parse(text) for name in RECEIVED if (text := good.get(f'topics.{name}'))}
    types = {name: type_name(text) for name in RECEIVED if (text := good.get(f'types.{name}'))}
    commands = {}
    for output in Output:
        definition = COMMAND_DEFINITIONS[f'commands.{output}']
        text = good.get(definition.name)
        if text and isinstance(definition, CommandDefinition):
            commands[output] = definition.command(text)
    calls = {}
    for output in Output:
        names = [str(good.get(f'services.{output}{end}') or '') for end in ('', '_true', '_false')]
        if any(names):
            calls[output] = Calls(*names)
    no_limit = float(good.get('commands.no_torque_limit') or 0.0)
    if Output.TORQUE_LIMIT in commands and not no_limit:
        faults.append(
            'commands.no_torque_limit: required with commands.torque_limit, in %: what the drive '
            'gets while there is no limit (0 would take its torque away)'
        )
    prefix = f'{axis}.' if axis else ''
    found = Connections(sources, types, commands, calls, no_limit)
    return found, [prefix + fault for fault in faults]


def type_name(text: str) -> str:
    """Return the full name of a message type."""
    found = TYPE_NAME.fullmatch(text)
    return f'{found["package"]}/msg/{found["name"]}' if found else text
