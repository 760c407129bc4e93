# SPDX-License-Identifier: Apache-2.0
"""A saved course is the same course, and a file that holds none is refused by name."""

import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.core.outcome import Jogged, MemberHome, Met, Outcome
from homing_node.course import Course, Happening, Sample
from homing_node.figures import record
from homing_node.procedures.states import HomeType, Input, State
from homing_node.rehearsal.examples import BEYOND, EXAMPLES

SUFFIXES = ('.npz', '.csv')
REAL = st.floats(allow_nan=False, allow_infinity=False)
#: By the kind of a field.
REALS = {float: REAL, float | None: st.none() | REAL}


@pytest.mark.parametrize('suffix', SUFFIXES)
@pytest.mark.parametrize(
    'home_type', [HomeType.HSHS, HomeType.HSReverseZPulse, HomeType.TouchProbe]
)
def test_a_course_comes_back(tmp_path, suffix, home_type):
    example = EXAMPLES[home_type]
    course = example.rehearse(BEYOND if BEYOND in example.runs else example.runs[0])
    path = tmp_path / f'run{suffix}'
    record.save(path, course, 'x: "HSHS", from\n0.05', 'rad')
    found, title, unit = record.load(path)
    assert (title, unit) == ('x: "HSHS", from\n0.05', 'rad')
    assert found.samples == course.samples
    assert found.happenings == course.happenings
    assert [type(one.value) for one in found.happenings] == [
        type(one.value) for one in course.happenings
    ]
    assert found.outcome == course.outcome
    assert found.arrows == course.arrows
    assert found.duration == course.duration and found.states == course.states


@pytest.mark.parametrize('suffix', SUFFIXES)
@settings(max_examples=30, deadline=None)
@given(
    samples=st.lists(
        st.builds(Sample, REAL, st.sampled_from(list(map(str, State))), *[REAL] * 4), max_size=5
    ),
    happenings=st.lists(
        st.builds(Happening, REAL, st.just(str(Input.HOME_SWITCH)), st.booleans(), REAL)
        | st.builds(Happening, REAL, st.just(str(Input.Z_PULSE)), REAL, REAL),
        max_size=5,
    ),
    outcome=st.none()
    | st.builds(
        Outcome,
        warnings=st.lists(st.text()).map(tuple),
        members=st.lists(st.builds(MemberHome, st.text(), st.text(), *[REAL] * 5)).map(tuple),
        jogged=st.none()
        | st.builds(
            Jogged,
            REAL,
            st.lists(st.builds(Met, REAL, st.sampled_from(Input), st.booleans(), *[REAL] * 3)).map(
                tuple
            ),
        ),
        **{name: REALS[kind] for name, kind in Outcome.__annotations__.items() if kind in REALS},
    ),
    title=st.text(),
)
def test_any_course_comes_back(tmp_path_factory, suffix, samples, happenings, outcome, title):
    samples.sort(key=lambda sample: sample.time)
    happenings.sort(key=lambda happening: happening.time)
    path = tmp_path_factory.mktemp('record') / f'run{suffix}'
    record.save(path, Course(samples, happenings, outcome), title)
    found = record.load(path)
    assert found == record.Record(Course(samples, happenings, outcome, []), title)


def test_a_record_of_old_is_in_metres(tmp_path):
    path = tmp_path / 'run.csv'
    record.save(path, Course())
    text = path.read_text()
    path.write_text(text.replace('# unit: "m"\n', ''))
    assert record.load(path).unit == 'm'
    path.write_text(text.replace('# unit: "m"', '# unit: "ft"'))
    with pytest.raises(record.InvalidRecord, match="'ft' is none of m, rad"):
        record.load(path)


def test_a_csv_is_a_table(tmp_path):
    path = tmp_path / 'run.csv'
    record.save(path, EXAMPLES[HomeType.HS].rehearse(EXAMPLES[HomeType.HS].runs[0]), 'x')
    lines = path.read_text().splitlines()
    head = [line for line in lines if line.startswith('#')]
    assert head[0] == '# format: "homing course 1"' and len(head) == 5
    assert lines[5] == 'time,state,position,velocity,acceleration,feedback,input,value'
    assert any(',home_switch,1.0' in line for line in lines)


@pytest.mark.parametrize('suffix', ['.txt', '', '.json'])
def test_other_formats_are_refused(tmp_path, suffix):
    path = tmp_path / f'run{suffix}'
    with pytest.raises(ValueError, match=r'\.npz or \.csv'):
        record.save(path, Course())
    path.write_text('')
    with pytest.raises(record.InvalidRecord, match=r'\.npz or \.csv'):
        record.load(path)


def test_a_missing_file_is_an_os_error(tmp_path):
    for suffix in SUFFIXES:
        with pytest.raises(FileNotFoundError):
            record.load(tmp_path / f'none{suffix}')


@pytest.mark.parametrize('suffix', SUFFIXES)
@pytest.mark.parametrize(
    'content', [b'', b'nonsense', b'PK\x03\x04broken', b'\xff\xfe\x00', b'a,b\n1,2\n']
)
def test_a_file_without_a_course_is_refused_by_name(tmp_path, suffix, content):
    path = tmp_path / f'run{suffix}'
    path.write_bytes(content)
    with pytest.raises(record.InvalidRecord, match=f'run{suffix}: no course in it'):
        record.load(path)


def test_a_torn_npz_is_refused(tmp_path):
    path = tmp_path / 'run.npz'
    record.save(path, EXAMPLES[HomeType.HS].rehearse(EXAMPLES[HomeType.HS].runs[0]))
    whole = path.read_bytes()
    for length in range(0, len(whole), len(whole) // 40):
        path.write_bytes(whole[:length])
        with pytest.raises(record.InvalidRecord):
            record.load(path)


def test_no_pickle_is_read(tmp_path):
    path = tmp_path / 'run.npz'
    np.savez(path, state=np.array([{'a': 1}], dtype=object))
    with pytest.raises(record.InvalidRecord, match='allow_pickle'):
        record.load(path)


@pytest.mark.parametrize(
    'old, new, said',
    [
        ('"homing course 1"', '"homing course 9"', 'homing course 9'),
        (',HSSearch,', ',HSSearch,x', 'line 7'),
        ('time,state', 'state,time', 'columns'),
        ('"error": "NoError"', '"error": "Nonsense"', 'Nonsense'),
        ('# outcome', '# result', 'outcome'),
    ],
)
def test_a_spoilt_csv_is_refused_with_the_place(tmp_path, old, new, said):
    path = tmp_path / 'run.csv'
    record.save(path, EXAMPLES[HomeType.HS].rehearse(EXAMPLES[HomeType.HS].runs[0]))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(record.InvalidRecord, match=said):
        record.load(path)


def test_what_stands_in_the_npz(tmp_path):
    path = tmp_path / 'run.npz'
    record.save(path, EXAMPLES[HomeType.HS].rehearse(EXAMPLES[HomeType.HS].runs[0]))
    assert zipfile.is_zipfile(path)
    with np.load(path) as file:
        assert {'time', 'state', 'position', 'velocity', 'acceleration', 'feedback'} <= set(file)
        assert len(file['time']) == len(file['state'])
        assert json.loads(str(file['about']))['outcome']['error'] == 'NoError'
