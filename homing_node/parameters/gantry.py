# SPDX-License-Identifier: Apache-2.0
"""A gantry: several drives on one axis, the leader and its followers.

The leader's parameters are the axis's. A follower has only what is its own, under
``<axis>.<follower>.``; everything else is the leader's. The full name of a follower is
``<axis>.<follower>``, such as ``y.y2``.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from ..procedures.states import LIMIT_PAIRS, Input, LimitPair, LSType
from .axis import DEFINITIONS, AxisParameters, axis_parameters
from .connections import CONNECTION_DEFINITIONS, Connections, connections
from .definition import Definition, InvalidParameters, unknown

FOLLOWER_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')

#: The dynamics: those of the weakest member hold for all.
DYNAMICS = (
    'homing_velocity_fast',
    'homing_velocity_fast_acc',
    'homing_velocity_fast_dec',
    'homing_velocity_slow',
    'homing_velocity_slow_acc',
    'homing_velocity_slow_dec',
    'home_shift_velocity',
    'home_shift_acc',
    'home_shift_dec',
    'ls_dec',
    'ls_slow_dec',
    'max_jerk',
)
#: What a follower may have of its own, besides its connections.
OWN = (
    'joint',
    'home_direction',
    'switches',
    'switch_offset',
    *(name for name in DEFINITIONS if name.startswith('invert_')),
    *(name for name in DEFINITIONS if name.endswith('ls_type')),
    *(name for name in DEFINITIONS if name.startswith('switch_') and name != 'switch_controllers'),
    'feedback_timeout',
    'feedback_clock',
    *(name for name in DEFINITIONS if name.startswith('gantry_homing_use_slave_')),
    *DYNAMICS,
)
#: The parameters of a follower, by their names below its own.
FOLLOWER_DEFINITIONS: Mapping[str, Definition] = {
    **{name: DEFINITIONS[name] for name in dict.fromkeys(OWN)},
    **CONNECTION_DEFINITIONS,
}
#: What stands before the dot in the names of an axis's connections.
GROUPS = frozenset(name.partition('.')[0] for name in CONNECTION_DEFINITIONS)
#: What belongs to the gantry as a whole.
_OF_GANTRY = ('followers', 'max_skew', 'joint')

#: The strength of the actions of a limit: a gantry does what its strongest one says.
STRENGTH = (
    LSType.none,
    LSType.SlowDec,
    LSType.SlowDecServoOff,
    LSType.Dec,
    LSType.DecServoOff,
    LSType.ServoOff,
)


def full_name(axis: str, follower: str) -> str:
    """Return the full name of a follower."""
    return f'{axis}.{follower}'


def split(below: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Separate the values below an axis's name: its own, and those of each of its followers."""
    names = below.get('followers')
    listed = names if isinstance(names, list | tuple) else ()
    own: dict[str, Any] = {}
    followers: dict[str, dict[str, Any]] = {name: {} for name in listed if isinstance(name, str)}
    for name, value in below.items():
        follower, dot, rest = name.partition('.')
        if dot and follower in followers:
            followers[follower][rest] = value
        else:
            own[name] = value
    return own, followers


def unlisted(axis: str, own: dict[str, Any]) -> list[str]:
    """Take the blocks of followers that are not listed out of an axis's values; name them."""
    blocks: dict[str, None] = {}
    for name in list(own):
        block, dot, rest = name.partition('.')
        if dot and block not in GROUPS and rest in FOLLOWER_DEFINITIONS:
            blocks[block] = None
            del own[name]
    return [
        f'{full_name(axis, block)}: {block!r} is none of the followers of {axis}: add it to '
        f'{axis}.followers, or delete its parameters'
        for block in blocks
    ]


def followers_of(
    axis: str, leader: AxisParameters, values: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, AxisParameters], dict[str, Connections], list[str]]:
    """Read the followers of an axis.

    Args:
        axis: The name of the axis.
        leader: The axis's parameters.
        values: What each follower has of its own, by its short name.

    Returns:
        The parameters and the connections of each, by full name, without what is wrong, and a
        message for each fault.
    """
    members: dict[str, AxisParameters] = {}
    connected: dict[str, Connections] = {}
    faults: list[str] = []
    for follower, own in values.items():
        name = full_name(axis, follower)
        faults += _bad_name(axis, follower)
        faults += [
            f"{name}.{key}: a gantry has one, the leader's: {axis}.{key}"
            if key in DEFINITIONS
            else f'{name}.{unknown(key, FOLLOWER_DEFINITIONS)}'
            for key in own
            if key not in FOLLOWER_DEFINITIONS
        ]
        connected[name], found = connections(own, name)
        faults += found
        try:
            members[name] = follower_parameters(leader, follower, own, name)
        except InvalidParameters as error:
            faults += error.faults
    return members, connected, faults


def follower_parameters(
    leader: AxisParameters, follower: str, own: Mapping[str, Any], name: str = ''
) -> AxisParameters:
    """Return the parameters of a follower: the leader's, with its own over them.

    ``name`` is its full name, for the messages. Raises InvalidParameters with every fault.
    """
    shared = {key: getattr(leader, key) for key in DEFINITIONS if key not in _OF_GANTRY}
    given = {key: value for key, value in own.items() if key in OWN}
    wired = given.pop('switches', leader.switches)
    # A follower need not have what the home type needs.
    found = axis_parameters({**shared, 'joint': follower, **given, 'switches': tuple(Input)}, name)
    try:
        return replace(found, switches=DEFINITIONS['switches'].convert(wired))
    except ValueError as error:
        raise InvalidParameters([f'{name}.{error}']) from None


def _bad_name(axis: str, follower: str) -> list[str]:
    if not FOLLOWER_NAME.fullmatch(follower):
        return [
            f'{axis}.followers: {follower!r} is not a name: a letter, then letters, digits and _'
        ]
    taken = GROUPS | set(DEFINITIONS) | {str(i) for i in Input} | _TOPICS
    if follower in taken:
        return [f'{axis}.followers: {follower!r} is a name of a parameter or a topic of an axis']
    return []


#: The last parts of an axis's topics and services.
_TOPICS = {
    'state',
    'home',
    'verify',
    'accept_home',
    'cancel',
    'continue',
    'servo',
    'servo_on',
    'torque_limit',
    'arm_latch',
}


def bad_gantries(
    names: Iterable[str],
    axes: Mapping[str, AxisParameters],
    followers: Mapping[str, Mapping[str, AxisParameters]],
    connected: Mapping[str, Connections],
) -> list[str]:
    """Return what is wrong with the gantries as a whole: shared names, shared signals.

    Args:
        names: The names of the axes.
        axes: The parameters of those that can be read.
        followers: Those of the followers of each, by their full names.
        connected: The connections of all.
    """
    faults = []
    listed = set(names)
    for axis, p in axes.items():
        if not p.followers:
            faults += _needless(axis, p)
            continue
        for follower in p.followers:
            if follower in listed:
                faults.append(
                    f'{axis}.followers: {follower!r} is one of the axes: a follower is none, take '
                    'it out of axes'
                )
        if p.switch_offset:
            faults.append(
                f'{axis}.switch_offset: is for a follower: {axis}.{p.followers[0]}.switch_offset'
            )
        members = {axis: p, **followers.get(axis, {})}
        faults += _shared_signals(members, connected)
    return faults


def _needless(axis: str, p: AxisParameters) -> list[str]:
    """Return which parameters of a gantry an axis without followers has."""
    return [
        f'{axis}.{name}: {getattr(p, name):g} m has no effect without followers'
        for name in ('max_skew', 'switch_offset')
        if getattr(p, name)
    ]


def _shared_signals(
    members: Mapping[str, AxisParameters], connected: Mapping[str, Connections]
) -> list[str]:
    """Return which inputs of a gantry read one signal: each must be an input of its own."""
    faults = []
    seen: dict[str, str] = {}
    for name, p in members.items():
        for source in p.inputs:
            signal = str(connected[name].source(name, source))
            place = f'{name}.{source}'
            other = seen.setdefault(signal, place)
            if other != place and source is not Input.SERVO_ENABLED:
                faults.append(
                    f'{name}.topics.{source}: {signal} is also {other}: on a gantry each switch '
                    'is an input of its own; leave out of switches what a side does not have'
                )
    return faults


# ----------------------------------------------------------------------- the gantry as one axis


def is_mirrored(leader: AxisParameters, follower: AxisParameters) -> bool:
    """Return whether a follower counts the other way round than the leader."""
    return leader.home_direction is not follower.home_direction


def leaders_input(leader: AxisParameters, follower: AxisParameters, source: Input) -> Input:
    """Return which input of the leader an input of a follower corresponds to.

    The limit switches are swapped where one of both counts the other way round.
    """
    swapped = is_mirrored(leader, follower) != (leader.ls_direction is not follower.ls_direction)
    if swapped:
        for pair in LIMIT_PAIRS.values():
            if source in pair:
                return pair[1 - pair.index(source)]
    return source


def group_parameters(
    leader: AxisParameters, followers: Iterable[AxisParameters]
) -> AxisParameters:
    """Return the parameters of a gantry as one axis, in the leader's coordinates.

    The inputs are those of all members, the action of a limit is the strongest one, the dynamics
    are the weakest ones.
    """
    members = [leader, *followers]
    changes: dict[str, Any] = {
        name: min(getattr(member, name) for member in members) for name in DYNAMICS
    }
    changes['home_shift_velocity'] = min(
        member.home_shift_velocity or member.homing_velocity_fast for member in members
    )
    inputs = [
        leaders_input(leader, member, source) for member in members for source in member.inputs
    ]
    changes['switches'] = tuple(dict.fromkeys(inputs))
    for pair in LimitPair:
        prefix = '' if pair is LimitPair.HARDWARE else f'{pair}_'
        changes[f'{prefix}ls_type'] = LSType.SeparatePositiveLSNegativeLS
        for side, switch in zip(('positive', 'negative'), LIMIT_PAIRS[pair], strict=True):
            changes[f'{prefix}{side}_ls_type'] = _strongest(leader, members, pair, switch)
    return replace(leader, **changes)


def _strongest(
    leader: AxisParameters, members: Iterable[AxisParameters], pair: LimitPair, switch: Input
) -> LSType:
    """Return the strongest action that members have for a limit switch of the leader."""
    types = [LSType.none]
    for member in members:
        for own, ls_type in zip(LIMIT_PAIRS[pair], member.ls_types(pair), strict=True):
            if own in member.inputs and leaders_input(leader, member, own) is switch:
                types.append(ls_type)
    return max(types, key=STRENGTH.index)
