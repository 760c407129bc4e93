# SPDX-License-Identifier: Apache-2.0
"""The kinds of files that can be read, and which kind a file is."""

import re
from collections.abc import Callable, Mapping
from types import ModuleType

from . import canopen, grbl, klipper, linuxcnc
from .converted import Converted, Row, Unconvertible

#: Every kind by its name: the module that reads it.
KINDS: Mapping[str, ModuleType] = {
    module.KIND: module for module in (linuxcnc, grbl, klipper, canopen)
}

#: What is seen of kinds that cannot be read.
OTHERS: Mapping[str, re.Pattern[str]] = {
    'a parameter file of this node, or of another ROS node': re.compile(r'\bros__parameters\s*:'),
    "Marlin's Configuration.h": re.compile(r'^\s*#define\s+\w*HOME', re.MULTILINE),
    "RepRapFirmware's G-code": re.compile(r'^\s*(M574|G1\s+H\d)', re.MULTILINE),
    "FluidNC's YAML": re.compile(r'^\s*homing:\s*$', re.MULTILINE),
    'a HAL file of LinuxCNC': re.compile(r'^\s*(loadrt|net|setp)\s', re.MULTILINE),
    'a URDF or another XML file': re.compile(r'^\s*<'),
}


def kind_of(text: str) -> str:
    """Return the kind of a file; raises Unconvertible, naming what it seems to be."""
    for kind, module in KINDS.items():
        recognises: Callable[[str], bool] = module.recognises
        if recognises(text):
            return kind
    known = ', '.join(KINDS)
    for name, pattern in OTHERS.items():
        if pattern.search(text):
            raise Unconvertible(f'this is {name}; known are {known}')
    raise Unconvertible(f'the kind of file is not known; known are {known}')


def convert(text: str, travel: float | None = None) -> Converted:
    """Read the homing configuration of a file.

    Args:
        text: What the file holds.
        travel: The mechanical travel in m or rad of axes for which the file has none.

    Raises:
        Unconvertible: The kind is not known, or the whole file has no equal here.
    """
    read: Callable[[str, float | None], Converted] = KINDS[kind_of(text)].read
    return read(text, travel)


def table(kind: str) -> tuple[Row, ...]:
    """Return the mapping of a kind of file."""
    rows: tuple[Row, ...] = KINDS[kind].TABLE
    return rows
