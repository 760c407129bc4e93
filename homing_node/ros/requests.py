# SPDX-License-Identifier: Apache-2.0
"""Requests of services whose type is a parameter: found, filled from YAML, and their answers read.

Only what every generated message has is used: `get_fields_and_field_types`.
"""

import re
from collections.abc import Mapping
from importlib import import_module
from typing import Any

_ARRAY = re.compile(r'sequence<(?P<bounded>.+?)(?:, *\d+)?>|(?P<fixed>.+)\[\d*\]')
_INTEGER = re.compile(r'(?P<unsigned>u?)int(?P<bits>8|16|32|64)')
_TEXT = re.compile(r'w?string(<\d+>)?')
#: What a service calls the field that says whether it has done it, and the one that says why not.
VERDICTS = ('success', 'successful', 'ok', 'accepted')
REASONS = ('message', 'reason', 'error_string', 'status_message')
#: Deeper than this no answer is searched.
DEPTH = 3


def service_type(name: str) -> Any:
    """Return a type of service by its name, such as ``std_srvs/srv/Trigger``.

    Raises:
        ValueError: There is none.
    """
    package, _, kind = name.partition('/srv/')
    try:
        return getattr(import_module(f'{package}.srv'), kind)
    except (ImportError, AttributeError, ValueError):
        raise ValueError(f'{name!r} is no type of a service that is installed here') from None


def filled(message: Any, fields: Mapping[str, Any]) -> Any:
    """Set fields of a message from plain values, and return it.

    An integer is rounded; an unsigned one takes a negative number as its two's complement, as an
    object of a drive does.

    Raises:
        ValueError: There is no such field, or the value does not fit it.
    """
    kinds = message.get_fields_and_field_types()
    for name, value in fields.items():
        if name not in kinds:
            raise ValueError(f'{name}: no such field; there are {", ".join(kinds) or "none"}')
        try:
            setattr(message, name, _value(kinds[name], value, getattr(message, name)))
        except ValueError as error:
            raise ValueError(f'{name}: {error}') from None
    return message


def _value(kind: str, value: Any, present: Any) -> Any:
    """Return a value as a field of a kind has it; ``present``: what the field has now."""
    array = _ARRAY.fullmatch(kind)
    if array is not None:
        if not isinstance(value, list):
            raise ValueError(f'{value!r} is not a list')
        element = array['bounded'] or array['fixed']
        return [_value(element, one, None) for one in value]
    if '/' in kind:
        if not isinstance(value, Mapping):
            raise ValueError(f'{value!r} is not a mapping')
        return filled(_message(kind) if present is None else present, value)
    return _plain(kind, value)


def _plain(kind: str, value: Any) -> Any:
    if _TEXT.fullmatch(kind):
        return str(value)
    if kind == 'boolean' and isinstance(value, bool):
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind in ('float', 'double') and number:
        return float(value)
    integer = _INTEGER.fullmatch(kind)
    if integer is not None and number and abs(value) < 2**64:
        bits, whole = int(integer['bits']), round(value)
        low = -(2 ** (bits - 1))
        high = 2**bits if integer['unsigned'] else -low
        if low <= whole < high:
            return whole % 2**bits if integer['unsigned'] else whole
    raise ValueError(f'{value!r} does not fit {kind}')


def _message(kind: str) -> Any:
    package, _, name = kind.partition('/')
    return getattr(import_module(f'{package}.msg'), name)()


def verdict(answer: Any) -> tuple[bool, str]:
    """Return whether an answer says yes, and what it says besides.

    An answer without any of `VERDICTS` says yes.
    """
    yes, texts = _judge(answer, DEPTH)
    return yes, '; '.join(texts)


def _judge(message: Any, depth: int) -> tuple[bool, list[str]]:
    yes, texts = True, []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if name in VERDICTS and isinstance(value, bool):
            yes = yes and value
        elif name in REASONS and isinstance(value, str) and value:
            texts.append(value)
        elif depth:
            for one in value if isinstance(value, list) else [value]:
                if hasattr(one, 'get_fields_and_field_types'):
                    below, more = _judge(one, depth - 1)
                    yes, texts = yes and below, texts + more
    return yes, texts
