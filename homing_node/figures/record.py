# SPDX-License-Identifier: Apache-2.0
"""Saves a course in one file and reads it again: `.npz` (NumPy) or `.csv` (for spreadsheets).

Both keep every number to its last bit, and nothing in them is code. The columns of a CSV are

    time, state, position, velocity, acceleration, feedback, input, value

A line has either what the axis did in a cycle (all but the last two) or what an input did there
(time, position, input, value); what is known of the run stands above them, after `#`, as JSON.
Times in s, positions raw in m or rad. The lines of a gantry have two columns more: `side`, the
follower's full name or nothing for the leader, and `force`, what its spring bears, N.
"""

import csv
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.outcome import Jogged, MemberHome, Met, Outcome
from ..course import Course, Happening, Sample
from ..procedures.events import Event
from ..procedures.states import LATCHES, Error, Input, State
from ..procedures.steps import Step

FORMAT = 'homing course 1'
#: Of a position: a linear axis, a rotary one.
UNITS = ('m', 'rad')
COLUMNS = (*Sample._fields, 'input', 'value')
OF_GANTRY = ('side', 'force')
REALS = ('time', 'position', 'velocity', 'acceleration', 'feedback')


class InvalidRecord(ValueError):
    """A file that holds no course; the message names the file and what is wrong."""


class Record(NamedTuple):
    """A course and its title; ``unit`` is the unit of its positions, m or rad."""

    course: Course
    title: str = ''
    unit: str = 'm'


def save(path: str | PathLike[str], course: Course, title: str = '', unit: str = 'm') -> None:
    """Write a course into a file whose suffix tells its format; ``unit``: m or rad.

    Raises ValueError for an unknown suffix, OSError where the file cannot be written.
    """
    path = Path(path)
    if path.suffix == '.csv':
        path.write_text(_csv(course, title, unit), encoding='utf-8')
    elif path.suffix == '.npz':
        arrays = _arrays(course)
        for name, other in course.followers.items():
            arrays |= {f'{name}/{key}': array for key, array in _arrays(other).items()}
            arrays[f'{name}/force'] = np.array(other.forces, dtype=float)
        with path.open('wb') as file:
            about = np.array(json.dumps(_about(course, title, unit)))
            np.savez_compressed(file, allow_pickle=False, about=about, **arrays)
    else:
        raise ValueError(f'{path}: a course is saved as .npz or .csv')


def _arrays(course: Course) -> dict[str, Any]:
    """Return what a course of one drive holds."""
    samples, happenings = course.samples, course.happenings
    return {
        'state': np.array([sample.state for sample in samples], dtype=np.str_),
        'input': np.array([each.input for each in happenings], dtype=np.str_),
        'happenings': np.array(
            [(each.time, float(each.value), each.position) for each in happenings], dtype=float
        ).reshape(-1, 3),
        **{
            name: np.array([getattr(sample, name) for sample in samples], dtype=float)
            for name in REALS
        },
    }


def load(path: str | PathLike[str]) -> Record:
    """Read a course.

    Raises InvalidRecord where the file holds none, OSError where it cannot be read.
    """
    path = Path(path)
    try:
        if path.suffix == '.csv':
            return _from_csv(path.read_text(encoding='utf-8'))
        if path.suffix == '.npz':
            with path.open('rb') as data, np.load(data, allow_pickle=False) as file:
                return _from_arrays(file)
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise InvalidRecord(f'{path}: no course in it: {error}') from None
    raise InvalidRecord(f'{path}: a course is in a file that ends with .npz or .csv')


def _about(course: Course, title: str, unit: str) -> dict[str, Any]:
    outcome = course.outcome
    about: dict[str, Any] = {
        'format': FORMAT,
        'title': title,
        'unit': unit,
        'outcome': None if outcome is None else {**outcome._asdict(), 'error': str(outcome.error)},
        'arrows': [
            [*map(str, step), str(event)]
            if isinstance(step, Step)
            else [str(step), '', str(event)]
            for step, event in course.arrows
        ],
    }
    if course.followers:
        about['mirrored'] = {name: other.mirrored for name, other in course.followers.items()}
    return about


def _courses(about: Mapping[str, Any], leader: Course) -> dict[str, Course]:
    """Return a course for each side, by its full name; the leader's by ''."""
    mirrored = dict(about.get('mirrored', {}))
    return {'': leader, **{name: Course(mirrored=bool(way)) for name, way in mirrored.items()}}


def _record(about: Mapping[str, Any], courses: dict[str, Course]) -> Record:
    if about.get('format') != FORMAT:
        raise ValueError(f'it says {about.get("format")!r}, not {FORMAT!r}')
    unit = about.get('unit', 'm')
    if unit not in UNITS:
        raise ValueError(f'the unit {unit!r} is none of {", ".join(UNITS)}')
    course = courses.pop('')
    course.followers = courses
    if any(len(other.samples) != len(course.samples) for other in courses.values()):
        raise ValueError('the sides have not the same number of cycles')
    course.outcome = _outcome(about['outcome'])
    course.arrows = [
        (Step(State(state), phase), Event(event)) for state, phase, event in about['arrows']
    ]
    return Record(course, about['title'], unit)


def _outcome(told: Mapping[str, Any] | None) -> Outcome | None:
    if not told:
        return None
    values = {
        'error': Error(told['error']),
        'warnings': tuple(told.get('warnings', ())),
        'members': tuple(MemberHome(*member) for member in told.get('members', ())),
        'jogged': _jogged(told.get('jogged')),
    }
    return Outcome(**{**told, **values})


def _jogged(told: Any) -> Jogged | None:
    if told is None:
        return None
    distance, edges = told
    return Jogged(distance, tuple(Met(time, Input(name), *rest) for time, name, *rest in edges))


def _happening(time: float, name: str, value: float, position: float) -> Happening:
    latch = Input(name) in LATCHES
    return Happening(time, name, value if latch else bool(value), position)


def _from_arrays(file: Mapping[str, Any]) -> Record:
    leader = _side(file, '')
    about = json.loads(str(file['about']))
    courses = _courses(about, leader)
    for name in about.get('mirrored', {}):
        side = _side(file, f'{name}/')
        courses[name].samples, courses[name].happenings = side.samples, side.happenings
        courses[name].forces = file[f'{name}/force'].tolist()
    return _record(about, courses)


def _side(file: Mapping[str, Any], before: str) -> Course:
    """Return the course of one drive; ``before`` stands before the names of its arrays."""
    states = [str(state) for state in file[f'{before}state']]
    columns = [file[f'{before}{name}'].tolist() for name in REALS]
    samples = [
        Sample(time, state, *rest) for state, time, *rest in zip(states, *columns, strict=True)
    ]
    found = [
        _happening(time, str(name), value, position)
        for name, (time, value, position) in zip(
            file[f'{before}input'], file[f'{before}happenings'].tolist(), strict=True
        )
    ]
    return Course(samples, found)


def _csv(course: Course, title: str, unit: str) -> str:
    text = StringIO()
    for name, value in _about(course, title, unit).items():
        text.write(f'# {name}: {json.dumps(value)}\n')
    writer = csv.writer(text, lineterminator='\n')
    more = OF_GANTRY if course.followers else ()
    writer.writerow((*COLUMNS, *more))
    rows: list[tuple[float, list[object]]] = []
    for side, one in {'': course, **course.followers}.items():
        forces: list[object] = [*one.forces, *[''] * (len(one.samples) - len(one.forces))]
        rows += [
            (sample.time, [*sample, '', '', side, force])
            for sample, force in zip(one.samples, forces, strict=True)
        ]
        for each in one.happenings:
            what = each.input, float(each.value)
            rows.append((each.time, [each.time, '', each.position, '', '', '', *what, side, '']))
    rows.sort(key=lambda row: row[0])
    width = len(COLUMNS) + len(more)
    writer.writerows(
        [repr(cell) if isinstance(cell, float) else cell for cell in row[:width]]
        for _, row in rows
    )
    return text.getvalue()


def _from_csv(text: str) -> Record:
    lines = text.splitlines()
    head = [line for line in lines if line.startswith('#')]
    about = {
        name.strip('# '): json.loads(value)
        for name, _, value in (line.partition(': ') for line in head)
    }
    courses = _courses(about, Course())
    for number, row in _rows(lines, len(head), OF_GANTRY if 'mirrored' in about else ()):
        try:
            course = courses[row.get('side', '')]
            if row['input']:
                course.happenings.append(
                    _happening(
                        float(row['time']),
                        row['input'],
                        float(row['value']),
                        float(row['position']),
                    )
                )
            else:
                reals = {name: float(row[name]) for name in REALS}
                course.samples.append(Sample(state=row['state'], **reals))
                if row.get('force'):
                    course.forces.append(float(row['force']))
        except (TypeError, ValueError) as error:
            raise ValueError(f'line {number}: {error}') from None
    return _record(about, courses)


def _rows(
    lines: list[str], skip: int, more: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    reader = csv.DictReader(lines[skip:])
    columns = (*COLUMNS, *more)
    if tuple(reader.fieldnames or ()) != columns:
        raise ValueError(f'the columns are not {", ".join(columns)}')
    for row in reader:
        yield skip + reader.line_num, row
