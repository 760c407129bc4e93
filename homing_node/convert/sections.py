# SPDX-License-Identifier: Apache-2.0
"""Reads files of sections with keys: LinuxCNC's ini and Klipper's cfg."""

import re
from collections.abc import Iterable

_SECTION = re.compile(r'\[([^\]]+)\]')
_KEY = re.compile(r'([A-Za-z_]\w*)\s*[=:]\s*(.*)')

Sections = dict[str, dict[str, str]]


def sections(text: str) -> Sections:
    """Return every section's keys and values; the last one of a name wins, comments go.

    A line that continues another one is not read.
    """
    found: Sections = {}
    current: dict[str, str] = {}
    for line in text.splitlines():
        if line[:1].isspace() and not line.lstrip().startswith('['):
            continued = _KEY.match(line.lstrip())
            if continued is None:
                continue
        stripped = re.split(r'(?:^|\s)[#;]', line, maxsplit=1)[0].strip()
        if head := _SECTION.fullmatch(stripped):
            current = found.setdefault(head[1].strip(), {})
        elif key := _KEY.fullmatch(stripped):
            current[key[1]] = key[2].strip()
    return found


def number(values: dict[str, str], *keys: str) -> float | None:
    """Return the first of some keys as a number, None where none is set or it is no number."""
    for key in keys:
        try:
            return float(values[key])
        except (KeyError, ValueError):
            continue
    return None


def shown(values: dict[str, str], keys: Iterable[str]) -> str:
    """Return the keys that are set, with their values, for a remark."""
    return ', '.join(f'{key} = {values[key]}' for key in keys if key in values)
