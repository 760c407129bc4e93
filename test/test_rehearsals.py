# SPDX-License-Identifier: Apache-2.0
"""How long axes take that have never homed: what is said of it, and the rehearsal itself."""

import json
import math
import threading
from types import SimpleNamespace

import pytest

from homing_node.parameters import yaml_file
from homing_node.parameters.definition import InvalidParameters
from homing_node.plant import layout_file
from homing_node.rehearsal.run import rehearse
from homing_node.ros import rehearsals
from homing_node.ros.rehearsals import NO_LAYOUT, NOT_YET, Rehearsals

VALUES = {
    'axes': ['x', 'z'],
    'x.home_type': 'HS',
    'x.switches': ['home_switch'],
    'x.travel': 0.2,
    'z.home_type': 'CurrentPos',
    'z.switches': [],
    'z.travel': 0.2,
}
LAYOUT = 'x: {hard_stops: [0.0, 0.2], home_switch: [0.1, 0.12], start: 0.0}\n'
START = 0.05


class Machine:
    """A node with two axes at rest, and its rehearsals; what past runs say is up to a test."""

    def __init__(self, folder, layout=LAYOUT):
        file = ''
        if layout:
            file = folder / 'layout.yaml'
            file.write_text(layout)
        self.warnings = []
        self.values = dict(VALUES)
        self.past = {}
        self.axes = {
            name: SimpleNamespace(
                running=False,
                raw_position=START,
                readings=SimpleNamespace(track=SimpleNamespace(samples=[(0.0, START)])),
            )
            for name in ('x', 'z')
        }
        node = SimpleNamespace(
            configuration=SimpleNamespace(layout=str(file)),
            values_of=lambda name: {
                **{k: v for k, v in self.values.items() if k.startswith(f'{name}.')},
                'axes': [name],
            },
            get_fully_qualified_name=lambda: '/cell1/homing_node',
            get_logger=lambda: SimpleNamespace(warning=self.warnings.append),
        )
        self.lock = threading.Lock()
        self.rehearsals = Rehearsals(
            node, self.axes, lambda name: self.past.get(name, math.nan), self.lock
        )

    def until(self, met):
        """Rehearse in this thread until something is met."""
        for name in self.axes:
            self.rehearsals.renew(name)
        self.rehearsals._run(met)


@pytest.fixture
def quick(monkeypatch):
    """Let a rehearsal end at once, as a test says; return what was rehearsed."""
    ran, answers = [], []

    def output(argv, folder, ended):
        ran.append(argv)
        return answers.pop(0) if answers else ('', 'homing: no answer is left')

    monkeypatch.setattr(rehearsals, '_output', output)
    monkeypatch.setattr(rehearsals, 'LOOK', 0.0)
    return SimpleNamespace(ran=ran, answers=answers)


def answer(success=True, time=3.0, error='', message=''):
    run = {'success': success, 'time': time, 'error': error, 'message': message}
    return json.dumps({'ok': success, 'runs': [run]}), ''


def test_without_a_layout_only_past_runs_say_how_long_it_takes(tmp_path, quick):
    made = Machine(tmp_path, layout='')
    assert math.isnan(made.rehearsals.expected('x'))
    assert made.rehearsals.unknown(['x', 'z']) == (
        f'how long x and z will take is not known: {NO_LAYOUT}'
    )
    made.rehearsals.start(lambda: False)  # starts no thread
    made.rehearsals.renew('x')
    made.rehearsals.join()
    made.past['x'] = 4.0
    assert made.rehearsals.expected('x') == 4.0
    assert made.rehearsals.unknown(['x']) == ''
    assert quick.ran == []


def test_a_layout_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InvalidParameters) as refused:
        Rehearsals(
            SimpleNamespace(configuration=SimpleNamespace(layout=str(tmp_path / 'none.yaml'))),
            {},
            lambda name: math.nan,
            threading.Lock(),
        )
    assert refused.value.faults == (f'layout: {tmp_path / "none.yaml"} is not a file',)


def test_what_has_not_homed_is_rehearsed_from_where_it_is(tmp_path, quick):
    made = Machine(tmp_path)
    made.past['z'] = 7.0
    quick.answers.append(answer(time=3.0))
    made.until(lambda: quick.ran and made.rehearsals.expected('x') == 3.0)
    ((*_, axis, start),) = quick.ran
    assert (axis, start) == ('x', f'--from={START!r}')
    assert made.rehearsals.expected('z') == 7.0
    made.past['x'] = 5.0  # a run on the machine says more than a rehearsal
    assert made.rehearsals.expected('x') == 5.0


def test_a_rehearsal_that_says_no_time_says_why(tmp_path, quick):
    made = Machine(tmp_path)
    quick.answers += [
        answer(success=False, error='LSTriggered', message='LSTriggered: x: it is there'),
        ('', 'homing: layout.yaml: no axis z\n  and more'),
    ]
    made.until(lambda: NOT_YET not in made.rehearsals.unknown(['x', 'z']))
    assert made.rehearsals.unknown(['x', 'z']) == (
        'how long x will take is not known: its rehearsal failed: LSTriggered: x: it is there; '
        'how long z will take is not known: it cannot be rehearsed: homing: layout.yaml: no axis z'
    )
    assert len(made.warnings) == 2


def test_nothing_is_rehearsed_while_an_axis_homes_or_before_it_is_heard(tmp_path, quick):
    made = Machine(tmp_path)
    made.axes['x'].running = True
    made.rehearsals.renew('z')
    assert made.rehearsals._next()[0] == ''
    made.axes['x'].running = False
    made.axes['z'].readings.track.samples = []
    assert made.rehearsals._next()[0] == ''
    made.axes['z'].readings.track.samples = [(0.0, START)]
    assert made.rehearsals._next()[0] == 'z'


def test_a_time_of_other_parameters_does_not_count(tmp_path, quick, monkeypatch):
    made = Machine(tmp_path)
    made.past['z'] = 1.0
    spent = rehearsals._output

    def changed(argv, folder, ended):
        if not quick.ran:
            made.rehearsals.renew('x')  # set while it is rehearsed
        return spent(argv, folder, ended)

    monkeypatch.setattr(rehearsals, '_output', changed)
    quick.answers += [answer(time=3.0), answer(time=9.0)]
    heard = []

    def met():
        heard.append(made.rehearsals.expected('x'))
        return heard[-1] == 9.0

    made.until(met)
    assert 3.0 not in heard
    assert len(quick.ran) == 2


@pytest.mark.long
def test_the_command_homing_rehearses_in_a_process_of_its_own(tmp_path):
    """Its time is that of the rehearsal; an axis that the layout lacks is named."""
    made = Machine(tmp_path)
    made.until(lambda: NOT_YET not in made.rehearsals.unknown(['x', 'z']))
    file = tmp_path / 'x.yaml'
    own = {name: value for name, value in VALUES.items() if name.startswith('x.')}
    file.write_text(yaml_file.written('/homing_node', {'axes': ['x'], **own}))
    checked = yaml_file.load(file)
    where = layout_file.load(tmp_path / 'layout.yaml').layouts['x']
    course = rehearse(checked.axes['x'], where, position=START)
    assert course.outcome.success
    assert made.rehearsals.expected('x') == pytest.approx(course.duration, rel=0.05)
    assert 'it cannot be rehearsed: homing: ' in made.rehearsals.unknown(['z'])
    assert 'z' in made.rehearsals.unknown(['z']).partition('homing: ')[2]
