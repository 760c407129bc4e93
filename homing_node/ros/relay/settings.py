# SPDX-License-Identifier: Apache-2.0
"""The parameters of the relay `homed_axes`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...parameters.axis import AxisParameters
from ...parameters.configuration import bad_names, configuration
from ...parameters.connections import TOPIC_NAME
from ...parameters.definition import Definition, InvalidParameters, read, table
from ...parameters.fields import FURTHEST, NamesDefinition
from ...parameters.node_fields import NODE_DEFINITIONS

#: The parameter of an axis that is its home.
HOME = Definition(
    'raw minus homed position: the home, known from before or told in the hand-over',
    float,
    'm or rad',
    -FURTHEST,
    FURTHEST,
    name='home_offset',
    default=None,
)
OWN = table(
    NODE_DEFINITIONS['axes'],
    Definition('the node that homes the axes', str, name='homing_node', default='homing_node'),
    NamesDefinition(
        'the controllers that get the motions: <controller>/joint_trajectory and '
        '<controller>/follow_joint_trajectory',
        list,
        name='controllers',
        default=(),
    ),
)


@dataclass(frozen=True)
class RelaySettings:
    """The parameters of the relay; ``homes``: those homes that are given at the start."""

    axes: Mapping[str, AxisParameters]
    homing_node: str
    controllers: tuple[str, ...]
    homes: Mapping[str, float]


def home_of(axis: str, value: object) -> float:
    """Return the value of ``<axis>.home_offset``.

    Raises:
        ValueError: It is no position.
    """
    try:
        return float(HOME.convert(value))
    except ValueError as error:
        raise ValueError(f'{axis}.{error}') from None


def settings_from(values: Mapping[str, Any]) -> RelaySettings:
    """Read the parameters; those of the homing node may stand beside them in the same file.

    Raises:
        InvalidParameters: Every fault, a line each.
    """
    values = {name: value for name, value in values.items() if value is not None}
    own, faults = read({name: values[name] for name in OWN if name in values}, OWN)
    names = own.get('axes', [])
    faults += bad_names(names) if not faults else []
    for name in [own.get('homing_node', ''), *own.get('controllers', ())]:
        if name and not TOPIC_NAME.fullmatch(name):
            faults.append(f'homing_node, controllers: {name!r} is not the name of a node')
    homes = {}
    for axis in names:
        given = values.get(f'{axis}.{HOME.name}')
        if given is not None:
            try:
                homes[axis] = home_of(axis, given)
            except ValueError as error:
                faults.append(str(error))
    of_relay = {*OWN, *(f'{axis}.{HOME.name}' for axis in names)} - {'axes'}
    try:
        axes = configuration(
            {name: value for name, value in values.items() if name not in of_relay}
        ).axes
    except InvalidParameters as error:
        raise InvalidParameters(dict.fromkeys([*faults, *error.faults])) from None
    if faults:
        raise InvalidParameters(faults)
    return RelaySettings(axes, own['homing_node'], tuple(own['controllers']), homes)
