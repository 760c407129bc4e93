# SPDX-License-Identifier: Apache-2.0
"""`homing history` and what `homing repeat` reports."""

import json
import random

import pytest

from homing_node.cli import main
from homing_node.cli.repeat import Homes
from homing_node.memory.disk import Disk
from homing_node.memory.quantities import HOME
from homing_node.memory.records import Head, Rest, Run
from homing_node.memory.store import Store
from homing_node.parameters.units import Unit

UM = 1e-6


def kept(folder, homes, axis='x', temperature=None, **changes):
    """Write the file of an axis that has found these homes."""
    runs = [
        Run(
            number,
            1.7e9 + 60 * number,
            'home',
            'NoError',
            2.5,
            home,
            2 * UM,
            frame='absolute',
            configuration='c',
            quantities={HOME: (home, 2 * UM)},
            temperature=temperature,
        )
        for number, home in enumerate(homes, 1)
    ]
    folder.mkdir(parents=True, exist_ok=True)
    rest = Rest(0.1, True, 0.1, **changes)
    Store(folder / f'{axis}.jsonl', Head(axis, 'm'), Disk()).save(rest, runs)


def homes(count, moved=lambda number: 0.0):
    rng = random.Random(1)
    return [0.1 + rng.gauss(0.0, UM) + moved(number) for number in range(count)]


def history(capsys, *arguments):
    status = main(['history', *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, out, err


def test_a_steady_axis(tmp_path, capsys):
    kept(tmp_path, homes(40))
    status, out, _ = history(capsys, 'x', '--memory', tmp_path, '--last', 3)
    assert status == 0
    assert 'axis x: 40 runs are kept, 40 of them homed' in out
    assert 'home is at 0.100000 m (raw), steady within 2' in out
    assert 'nothing moves' in out
    assert out.count('NoError') == 3 and '   40  20' in out


def test_the_temperature_stands_beside_each_run(tmp_path, capsys):
    kept(tmp_path, homes(6), temperature=21.46)
    _, out, _ = history(capsys, 'x', '--memory', tmp_path)
    assert out.count('21.5 °C') == 6
    _, out, _ = history(capsys, 'x', '--memory', tmp_path, '--json')
    assert json.loads(out)['runs'][0]['temperature'] == 21.46


def test_a_switch_that_has_moved(tmp_path, capsys):
    kept(tmp_path, homes(45, lambda number: 50 * UM if number >= 40 else 0.0))
    status, out, _ = history(capsys, 'x', '--memory', tmp_path)
    assert status == 1
    assert 'nothing moves' not in out and 'home stepped by +' in out
    assert 'at run 41 (20' in out


def test_a_drift_in_words_and_as_json(tmp_path, capsys):
    kept(tmp_path, homes(80, lambda number: UM * max(0, number - 40)))
    status, out, _ = history(capsys, 'x', '--memory', tmp_path)
    assert status == 1 and 'home drifts by +' in out and ' a run since run ' in out
    status, out, _ = history(capsys, 'x', '--memory', tmp_path, '--json')
    report = json.loads(out)
    assert status == 1 and not report['ok'] and len(report['runs']) == 80
    assert report['trends'][0].startswith('home drifts')
    assert report['runs'][0]['home_position_raw'] == pytest.approx(0.1, abs=1e-5)


def test_a_control_chart(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kept(tmp_path / 'm', homes(20, lambda number: 1e-4 if number == 15 else 0.0))
    status, out, _ = history(capsys, 'x', '--memory', 'm', '--plot')
    assert status == 0 and 'wrote x_history.png' in out
    assert (tmp_path / 'x_history.png').read_bytes()[:4] == b'\x89PNG'
    assert history(capsys, 'x', '--memory', 'm', '--plot', 'a.svg')[0] == 0
    drawn = (tmp_path / 'a.svg').read_text()
    assert '<svg' in drawn and 'x: homes around 0.100000 m (raw)' in drawn
    status, _, err = history(capsys, 'x', '--memory', 'm', '--plot', 'a.xyz')
    assert status == 2 and 'a.xyz' in err
    kept(tmp_path / 'm', homes(3))
    status, out, err = history(capsys, 'x', '--memory', 'm', '--plot')
    assert status == 1 and 'too few runs to draw' in err
    assert 'the first 5 are only collected' in out


def test_the_folder_is_that_of_the_node(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv('ROS_HOME', str(tmp_path))
    kept(tmp_path / 'homing' / 'cell_1' / 'homing_node', homes(6), axis='y')
    assert history(capsys, 'y', '--node', '/cell_1/homing_node')[0] == 0
    status, _, err = history(capsys, 'x', '--node', 'cell_1/homing_node')
    assert status == 2 and 'x.jsonl: No such file' in err and 'there is y' in err
    status, _, err = history(capsys, 'y', '--memory', '')
    assert status == 2 and '--memory' in err


def test_a_rotary_axis_and_an_empty_file(tmp_path, capsys):
    kept(tmp_path, homes(6), unit='rad')
    assert 'rad (raw), steady within' in history(capsys, 'x', '--memory', tmp_path)[1]
    kept(tmp_path, [])
    status, _, err = history(capsys, 'x', '--memory', tmp_path)
    assert status == 1 and 'there is no run of axis x in the file' in err


def test_what_repeat_reports():
    found = Homes([0.1, 0.1 + 2 * UM, 0.1 + 4 * UM], [3 * UM, 3 * UM, 1 * UM])
    assert found.range == pytest.approx(4 * UM)
    assert found.drift == pytest.approx(2 * UM)
    assert found.deviation == pytest.approx(1.633 * UM, rel=1e-3)
    assert found.promised == pytest.approx(6 * UM) and found.kept
    text = '\n'.join(found.lines(Unit.m))
    assert '3 homes, on average at 0.100002 m (raw)' in text
    assert 'spread: 4 µm in all, 1.63 µm standard deviation' in text
    assert 'drift: +2 µm from run to run' in text
    assert 'uncertainty: 3 µm, so that two homes are within 6 µm: that holds' in text
    wide = Homes([0.1, 0.1 + 7 * UM], [3 * UM, 3 * UM])
    assert not wide.kept and 'does not hold' in wide.lines(Unit.m)[-1]
