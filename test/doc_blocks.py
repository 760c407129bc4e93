# SPDX-License-Identifier: Apache-2.0
"""The fenced blocks of the documentation, which its tests run and compare."""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOC = ROOT / 'doc'
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted(DOC.rglob('*.md'))]
README = ROOT / 'README.md'
GUIDE = DOC / 'guide.md'
TUTORIAL = DOC / 'tutorial.md'
ROS_INTERFACE = DOC / 'ros_interface.md'


class Block(NamedTuple):
    """A fenced block of a page."""

    page: Path
    language: str
    text: str
    line: int

    @property
    def id(self):
        return f'{self.page.name}:{self.line}'


def blocks_of(page):
    text = page.read_text()
    for found in re.finditer(r'^```(\w*)\n(.*?)^```$', text, re.MULTILINE | re.DOTALL):
        yield Block(page, found[1], found[2], text.count('\n', 0, found.start()) + 1)


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def each(language):
    found = [b for b in BLOCKS if b.language == language]
    return pytest.mark.parametrize('block', found, ids=lambda b: b.id)


def commands(first):
    """Return the words of every documented command that begins with these words."""
    lines = [line for b in BLOCKS if b.language == 'bash' for line in b.text.splitlines()]
    words = [shlex.split(line, comments=True) for line in lines]
    return [w for w in words if w[: len(first)] == list(first)]


def axes_yaml():
    """Return README's own axis."""
    return next(b.text for b in blocks_of(README) if b.language == 'yaml')
