# SPDX-License-Identifier: Apache-2.0
"""Rules about the setpoint topic and ros2_control: listeners, other publishers, who is active."""

from collections.abc import Iterable, Iterator, Sequence

from ..check.finding import Finding, Severity
from ..parameters.axis import AxisParameters
from ..procedures.states import Apply
from .controller import ACTIVE, is_known, judge_controller
from .facts import Controller, Endpoint, Facts, Manager, Setpoints

#: Nodes of the command line look at topics, they move nothing.
TOOLS = '_ros2cli'
#: How the graph names a node whose name is not discovered yet.
NO_NAME = '_NODE_NAME_UNKNOWN_'
#: The node of the relay, where an axis names none.
RELAY = 'homed_axes'


def listens(controller: Controller) -> bool:
    """Tell whether a subscriber may be a controller: it is no tool of the command line."""
    return not controller.node.rpartition('/')[2].startswith(TOOLS)


def judge_listeners(facts: Facts) -> Iterator[Finding]:
    """Yield what is wrong with the nodes at the setpoint topic."""
    setpoints = facts.setpoints
    relays = relays_of(facts.node, (p for _, p in setpoints.axes.values()))
    second = others(facts.node, facts.publishers, relays)
    yield from _publishers(facts.node, setpoints.topic, second, facts.twins)
    controllers = [one for one in facts.controllers if listens(one)]
    if not controllers:
        yield Finding(
            Severity.error,
            '',
            'no-controller',
            f'nobody subscribes to {setpoints.topic}',
            'no run starts (NoController): is the controller loaded, and does its topic, or the '
            "node's remapping of ~/setpoints or ~/position_commands, name the same topic?",
        )
    known = [one for one in controllers if is_known(one, setpoints.interface)]
    for one in known:
        yield from judge_controller(one, setpoints, facts.lags)
        yield from _state(one, setpoints, facts.managers)
    if controllers and not known:
        names = ', '.join(one.node for one in controllers)
        yield Finding(
            Severity.info,
            '',
            'controller-unknown',
            f'the parameters of {names} name no joints, or cannot be read',
            'whether it plays the setpoints as they are cannot be told',
        )
    for manager in facts.managers:
        yield from _manager(manager, known)


def others(node: str, publishers: Sequence[Endpoint], relays: Iterable[str] = ()) -> list[str]:
    """Return the nodes that publish the setpoints besides the node itself and its relays.

    Their twins are others: nodes of the same name. A node that has just come has no name yet: it
    may be one of those that are not seen.
    """
    names = [one.node for one in publishers]
    unnamed = [name for name in names if NO_NAME in name]
    for one in (node, *relays):
        if one in names:
            names.remove(one)
        elif unnamed:
            names.remove(unnamed.pop())
    return sorted(names)


def relay_of(node: str, p: AxisParameters) -> str:
    """Return the full name of the relay that an axis names; ``node``: the homing node's name."""
    name = p.apply_service or RELAY
    return name if name.startswith('/') else f'{node.rpartition("/")[0]}/{name}'


def relays_of(node: str, axes: Iterable[AxisParameters]) -> set[str]:
    """Return the full names of the relays that some axes name."""
    return {relay_of(node, p) for p in axes if p.apply is Apply.relay}


def _publishers(node: str, topic: str, second: Sequence[str], twins: int) -> Iterator[Finding]:
    if second:
        yield Finding(
            Severity.error,
            '',
            'setpoint-publishers',
            f'{", ".join(second)} publishes on {topic}, too',
            'no run starts (PublisherConflict): two sources would move the axis to and fro; end '
            'the other one (one that was killed stays listed for about 20 s)',
        )
    if twins > 1:
        yield Finding(
            Severity.error,
            '',
            'node-twice',
            f'{twins} nodes have the name {node}',
            'each answers requests, both command the axes: end one, or give it another name',
        )


def _state(
    controller: Controller, setpoints: Setpoints, managers: Sequence[Manager]
) -> Iterator[Finding]:
    if controller.state in ('', ACTIVE):
        if controller.state and controller.claimed is not None:
            yield from _claimed(controller, setpoints)
        return
    holders = sorted(
        {
            name
            for manager in managers
            for name, claims in (manager.claims or {}).items()
            if name != controller.node
            and {claim.rpartition('/')[0] for claim in claims} & set(setpoints.axes)
        }
    )
    also = f', and deactivate {", ".join(holders)}, which holds the joints' if holders else ''
    yield Finding(
        Severity.error,
        '',
        'controller-inactive',
        f'{controller.node} is {controller.state}',
        f'no run starts (NoController): activate it{also}',
        right=f'ros2 control switch_controllers --activate {controller.node.rpartition("/")[2]}'
        + (f' --deactivate {" ".join(n.rpartition("/")[2] for n in holders)}' if holders else ''),
    )


def _claimed(controller: Controller, setpoints: Setpoints) -> Iterator[Finding]:
    held = {claim.rpartition('/')[0] for claim in controller.claimed or ()}
    missing = [joint for joint in setpoints.axes if joint not in held]
    if missing:
        yield Finding(
            Severity.warning,
            '',
            'controller-claims',
            f'{controller.node} is active, but holds no command interface of {", ".join(missing)}',
            'the joint does not move with the setpoints',
        )


def _manager(manager: Manager, known: Sequence[Controller]) -> Iterator[Finding]:
    if manager.claims is None:
        yield Finding(
            Severity.info,
            '',
            'manager-messages',
            f'{manager.node} cannot be asked: controller_manager_msgs is not installed here',
            'whether the controller is active is known only from its own transitions',
        )
    given = manager.parameters or {}
    if given.get('enforce_command_limits') is True:
        yield Finding(
            Severity.warning,
            '',
            'enforce-limits',
            f'{manager.node}: enforce_command_limits is true',
            'it holds the raw command within the position limits of the robot description, which '
            'mean nothing before the axis is homed: a search that passes one stops there, and '
            'ends with FollowingError; or switch off the limits of these joints '
            '(<limits enable="false"/> in their position command interface)',
            'enforce_command_limits',
            'true',
            False,
        )
    rate = given.get('update_rate')
    if isinstance(rate, int | float):
        for one in known:
            own = (one.parameters or {}).get('update_rate')
            if isinstance(own, int | float) and own > rate:
                yield Finding(
                    Severity.info,
                    '',
                    'manager-rate',
                    f'{manager.node} runs at {rate:g} Hz, {one.node} asks for {own:g} Hz',
                    'the controller runs at the rate of the manager',
                    'update_rate',
                    float(own),
                    float(rate),
                    'Hz',
                )
