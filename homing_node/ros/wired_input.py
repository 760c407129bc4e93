# SPDX-License-Identifier: Apache-2.0
"""One thing that is received of an axis: where it comes from, and what is known of it."""

from collections.abc import Iterable
from dataclasses import dataclass

from ..core.axis import Axis
from ..language.expression import DATA, Lookup, Part, Path, Source, Value
from ..parameters.connections import FEEDBACK, TEMPERATURE
from ..procedures.states import LATCHES, Input

#: The type of a topic that is named without an expression.
BOOL, FLOAT64 = 'std_msgs/msg/Bool', 'std_msgs/msg/Float64'
JOINT_STATE = 'sensor_msgs/msg/JointState'
TEMPERATURES = 'sensor_msgs/msg/Temperature'

#: What is meant in a message of a temperature.
WARMTH = Value(Path((Part(TEMPERATURE),)))


@dataclass(eq=False)
class WiredInput:
    """One input of an axis, its feedback, or its temperature.

    Attributes:
        axis: the axis.
        source: an `Input`, FEEDBACK or TEMPERATURE.
        written: what the user wrote for it.
        told: the type of its topic, as the user told it; '' where he did not.
        topic: the full name of its topic.
        heard: whether its present publisher has said its value, and the last message did.
        missing: why the last message did not say it.
        problem: why the expression does not fit the type.
        counter: the counter of the last latch.
    """

    axis: Axis
    source: str
    written: Source
    told: str
    topic: str
    heard: bool = False
    missing: str = ''
    problem: str = ''
    counter: float | None = None

    @property
    def name(self) -> str:
        return f'{self.source} ({self.written.at(self.topic)})'

    @property
    def is_feedback(self) -> bool:
        return self.source == FEEDBACK

    @property
    def is_temperature(self) -> bool:
        return self.source == TEMPERATURE

    @property
    def joint(self) -> str:
        """The joint whose feedback it is, '' of an input."""
        return (self.axis.parameters.joint or self.axis.name) if self.is_feedback else ''

    @property
    def is_switch(self) -> bool:
        others = (FEEDBACK, TEMPERATURE, Input.SERVO_ENABLED)
        return self.source not in others and self.source not in LATCHES

    @property
    def default_kind(self) -> str:
        """The type of the topic as long as nobody says another; '' where any may be meant."""
        if self.told or self.written.value is not None:
            return self.told
        if self.is_temperature:
            return TEMPERATURES
        return JOINT_STATE if self.is_feedback else FLOAT64 if self.source in LATCHES else BOOL

    def lose(self, why: str = '') -> None:
        """Forget what was heard."""
        self.heard, self.missing, self.counter = False, why, None


def default_value(fields: Iterable[str], joint: str = '') -> Value:
    """Return what is meant where the user names only a topic.

    Args:
        fields: the fields of its type.
        joint: the joint whose feedback it is; '' for an input.
    """
    if 'data' in fields:
        return DATA
    if joint:
        return Value(Lookup(joint, 'position'))
    return WARMTH if TEMPERATURE in fields else DATA
