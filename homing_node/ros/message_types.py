# SPDX-License-Identifier: Apache-2.0
"""Message types by their names: their classes, and their layouts for the language of inputs."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any

from ..language.layout import Structure, layout_of


def message_class(kind: str) -> Any:
    """Return the class of a message type ``package/msg/Name`` or ``package/Name``.

    Raises:
        LookupError: it is not installed here; the message says what is missing.
    """
    package, _, name = kind.replace('/msg/', '/').partition('/')
    try:
        module = import_module(f'{package}.msg')
    except ImportError:
        raise LookupError(f'there is no package {package}') from None
    found = getattr(module, name, None)
    if found is None:
        raise LookupError(f'the package {package} has no message {name}')
    return found


@cache
def layout(kind: str) -> Structure:
    """Return the layout of a message type; raises BadExpression where it is not installed."""
    return layout_of(kind, _fields_of)


def kind_of(message: Any) -> str:
    """Return the name of the type of a message class, ``package/msg/Name``."""
    return f'{message.__module__.partition(".")[0]}/msg/{message.__name__}'


def _fields_of(kind: str) -> Mapping[str, str]:
    fields: Mapping[str, str] = message_class(kind).get_fields_and_field_types()
    return fields
