# SPDX-License-Identifier: Apache-2.0
"""What the verbs share that talk to a running node: is it there, does it answer, Ctrl-C."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from .common import FAILED, INTERRUPTED, Failure

#: How long to look for the node, and to wait for a short answer, s.
PATIENCE = 5.0

STATUS = """\
The status is 2 where there is no such node, and 1 where it dies or falls silent. Ctrl-C cancels
what was asked, waits until the axes are at rest, and ends with status 130.

"""


def full(name: str) -> str:
    """Return the full name of a node that a user has written."""
    return f'/{name.strip("/")}'


def absent(node: str, there: list[str], verb: str) -> list[str]:
    """Return the lines that say that a node is not there, and which homing nodes are."""
    lines = [f'there is no homing node {node}']
    if there:
        return [*lines, f'there is {", ".join(there)}: homing {verb} --node {there[0]}']
    return [
        *lines,
        f'there is none at all within {PATIENCE:g} s: is it running, with the same ROS_DOMAIN_ID '
        'and ROS_AUTOMATIC_DISCOVERY_RANGE?',
    ]


def coordinator(node: str, verb: str, cells: Sequence[str]) -> str:
    """Return the line that says that a node is a coordinator, of which a verb wants too much."""
    return (
        f'{node} is a coordinator, which homes and cancels only; ask the node of a cell: '
        f'homing {verb} --node {cells[0]}'
    )


@contextmanager
def connected(arguments: argparse.Namespace) -> Iterator[Any]:
    """Yield a client of the running node.

    Raises:
        Failure: ROS is missing, the node is not there, or it dies or falls silent meanwhile; or
            Ctrl-C, once what was asked is canceled.
    """
    verb = arguments.command
    try:
        from ..client import Abandoned, HomingClient, Interrupted, NotThere
    except ImportError as error:
        raise Failure(f'`homing {verb}` needs ROS 2 ({error})') from None
    node = full(arguments.node)
    with HomingClient(node, discovery=PATIENCE) as client:
        try:
            if not client.wait_for_node():
                raise Failure(*absent(node, client.others(), verb))
            yield client
        except Interrupted as ended:
            text = ended.result.message
            raise Failure(
                f'interrupted; the axes are at rest: {text}', status=INTERRUPTED
            ) from None
        except Abandoned:
            text = 'interrupted twice; canceled, but it is not known whether an axis still moves'
            raise Failure(text, status=INTERRUPTED) from None
        except NotThere as error:
            raise Failure(str(error), status=FAILED) from None
        except TimeoutError as error:
            raise Failure(
                f'{error}; it is not known whether an axis still moves', status=FAILED
            ) from None


def axes_of(client: Any, verb: str, asked: Sequence[str] = ()) -> list[str]:
    """Return the axes that were asked for, or all of the node.

    Raises:
        Failure: One is not there, or the node is a coordinator, which only homes and cancels.
    """
    known = list(client.parameters('axes').get('axes', ()))
    cells = client.parameters('nodes').get('nodes', ()) if not known else ()
    if cells:
        raise Failure(coordinator(client.node_name, verb, cells))
    for axis in asked:
        if axis not in known:
            raise Failure(f'{axis!r} is none of the axes {", ".join(known)}')
    return list(asked) or known
