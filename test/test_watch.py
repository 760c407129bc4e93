# SPDX-License-Identifier: Apache-2.0
"""What `homing watch` knows and shows, without a graph."""

import io
import json
import re
import time
from types import SimpleNamespace

import pytest
from rich.console import Console

from homing_node.cli import main, watch
from homing_node.cli.common import Failure
from homing_node.cli.watch_table import STANDS_OUT, short, table, text_of
from homing_node.diagnosis.board import Board
from homing_node.procedures.states import Input

SOURCES = {
    'home_switch': 'on, 0.120 s, 50 Hz, /io#data & 0x02, low',
    'z_pulse': 'unknown, -, -, /drive/index',
}


def state(**changes):
    """Return what a board reads of an AxisState."""
    fields = {
        'state': 'Idle',
        'paused': False,
        'homed': False,
        'home_source': 'none',
        'position': 0.25,
        'home_offset': 0.5,
        'uncertainty': 1e-5,
        'error': 'NoError',
        'message': '',
        'inputs': ['home_switch', 'z_pulse'],
        'levels': [0, 2],
    }
    return SimpleNamespace(**{**fields, **changes})


def board(*states, told=SOURCES):
    """Return a board that has heard of axis x, at 0 s, 1 s, ..., and its changes."""
    made, changes = Board(), []
    made.take_inputs('x', told)  # the diagnostics may come first
    for now, one in enumerate(states):
        changes += made.take_state('x', one, float(now))
    return made, [f'{one.axis}: {one.text}' for one in changes]


def test_positions_are_raw_until_the_axis_is_homed():
    made, _ = board(state())
    assert (made.axes['x'].raw, made.axes['x'].position) == (0.25, None)
    made, changes = board(state(), state(homed=True, home_source='restored'))
    assert (made.axes['x'].raw, made.axes['x'].position) == (0.75, 0.25)
    assert made.axes['x'].homed == 'restored' and changes == ['x: homed']


def test_what_the_diagnostics_say_of_an_input():
    made, _ = board(state())
    home, pulse = made.axes['x'].inputs.values()
    assert home == ('off', '0.120 s', '50 Hz', '/io#data & 0x02, low', float('-inf'))
    assert (pulse.age, pulse.source) == ('-', '/drive/index')
    made.take_inputs('x', {'home_switch': 'nonsense'})
    assert made.axes['x'].inputs['home_switch'] == home


def test_changes():
    made, changes = board(
        state(),
        state(levels=[1, 2]),
        state(state='HSSearch', levels=[1, 2]),
        state(state='HSSearch', paused=True, levels=[1, 2]),
        state(error='LSTriggered', message='axis x: it rose', levels=[1, 2]),
        state(error='LSTriggered', message='axis x: it rose', levels=[9, 2]),
    )
    assert changes == [
        'x: home_switch on',
        'x: HSSearch',
        'x: HSSearch, paused',
        'x: Idle',
        'x: LSTriggered: axis x: it rose',
        'x: home_switch unknown',
    ]
    assert made.axes['x'].inputs['home_switch'].changed == 5.0
    assert made.heard == 5.0


ESCAPE = re.compile(r'\x1b\[[0-9;]*m')


def shown(made, now, width, height=50, colour=True):
    screen = Console(
        file=io.StringIO(), width=width, force_terminal=True, no_color=not colour, highlight=False
    )
    screen.print(table(made, now, width, height))
    return screen.file.getvalue()


@pytest.mark.parametrize('colour', [True, False])
@pytest.mark.parametrize('width', [40, 70, 130])
def test_an_input_that_has_changed_stands_out(width, colour):
    made, _ = board(state(), state(levels=[1, 2]))
    fresh, later = (shown(made, now, width, colour=colour) for now in (1.1, 1.1 + STANDS_OUT))
    assert ' <' in fresh and ' <' not in later
    assert ('\x1b[1;32m' in later) == colour
    assert all(len(line) <= width for line in ESCAPE.sub('', fresh).splitlines())


def test_a_wide_terminal_has_a_line_for_each_input():
    made, _ = board(state(homed=True, home_source='run'))
    wide = shown(made, 0.0, 150)
    assert '/io#data & 0x02, low' in wide and '0.120 s' in wide and '0.750000' in wide
    low = shown(made, 0.0, 150, height=5)
    assert '/io' not in low and 'home:off' in low


def test_plain_lines():
    made, _ = board(state(error='LSTriggered', message='axis x: it rose'))
    assert text_of(made) == [
        'x: Idle, not homed, raw 0.250000',
        '  LSTriggered: axis x: it rose',
        '  home_switch: off, 0.120 s, 50 Hz, /io#data & 0x02, low',
        '  z_pulse: latch, -, -, /drive/index',
    ]


def test_short_names_are_different():
    names = [short(str(one)) for one in Input]
    assert len(set(names)) == len(names)
    assert [short('home_switch'), short('near_positive_limit_switch')] == ['home', 'near+']
    assert short('negative_limit_switch') == 'lim-'


class Silent:
    """A watcher that has heard one state, long ago."""

    def __init__(self, target, axes, there):
        self.target, self.there = target, there
        self.board, self.found = Board(), {'x'}
        self.board.take_state('x', state(), time.monotonic() - 60.0)

    def nodes(self):
        return self.there

    def poll(self):
        return []

    def close(self):
        pass


@pytest.mark.parametrize(
    ('there', 'said'),
    [
        (['/homing_node'], '/homing_node has been silent for \\d+ s, though it is still listed'),
        ([], '/homing_node has ended, or is out of reach'),
    ],
)
@pytest.mark.parametrize('options', [[], ['--json']])
def test_a_node_that_says_nothing_any_more(monkeypatch, capsys, there, said, options):
    monkeypatch.setattr(
        'homing_node.ros.watching.Watcher', lambda target, axes: Silent(target, axes, there)
    )
    monkeypatch.setattr(watch, 'POLL_PERIOD', 0.0)
    assert main(['watch', *options]) == 1
    out, err = capsys.readouterr()
    assert re.fullmatch(f'homing: {said}\n', err)
    if options:
        assert json.loads(out)['axes']['x']['inputs']['home_switch']['level'] == 'off'


def test_an_axis_that_is_not_there(monkeypatch, capsys):
    monkeypatch.setattr(
        'homing_node.ros.watching.Watcher',
        lambda target, axes: Silent(target, axes, ['/homing_node']),
    )
    monkeypatch.setattr(watch, 'PATIENCE', 0.1)
    assert main(['watch', 'u']) == 2
    assert capsys.readouterr().err == "homing: 'u' is none of the axes x\n"


def test_the_live_table_gives_way_to_the_node(monkeypatch):
    """It takes turns with the node on a machine with few cores."""
    made, _ = board(state())
    screen = Console(file=io.StringIO(), width=100, force_terminal=True)
    given = []
    monkeypatch.setattr(watch.os, 'nice', given.append)
    monkeypatch.setattr(watch, 'console', lambda: screen)
    watcher = SimpleNamespace(poll=lambda: [], board=made, target='/n', nodes=lambda: [])
    with pytest.raises(Failure):
        watch._show(watcher)
    assert given == [watch.GIVES_WAY] and watch.GIVES_WAY > 0
    assert 'home_switch' in screen.file.getvalue()
