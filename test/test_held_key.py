# SPDX-License-Identifier: Apache-2.0
"""A held key of a terminal, as the deadman of a survey."""

import os
import pty
import termios
import time
from types import SimpleNamespace

from homing_node.cli import held_key
from homing_node.cli.held_key import HeldKey


def test_a_key_counts_as_held_for_a_while_after_each_repeat(monkeypatch):
    lead, follow = pty.openpty()
    monkeypatch.setattr('sys.stdin', SimpleNamespace(fileno=lambda: follow))
    monkeypatch.setattr(held_key, 'HOLD', 0.2)
    before = termios.tcgetattr(follow)
    try:
        with HeldKey() as key:
            assert not key.held()
            os.write(lead, b' ')  # no line: the key itself is read at once
            until = time.monotonic() + 5.0
            while not key.held() and time.monotonic() < until:
                time.sleep(0.005)
            assert key.held()
            until = time.monotonic() + 5.0
            while key.held() and time.monotonic() < until:
                time.sleep(0.005)
            assert not key.held()
        assert termios.tcgetattr(follow) == before
    finally:
        os.close(lead)
        os.close(follow)
