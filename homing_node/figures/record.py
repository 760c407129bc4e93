# SPDX-License-Identifier: Apache-2.0
"""Saves a course in one file and reads it again: `.npz` (NumPy) or `.csv` (for spreadsheets).

Both keep every number to its last bit, and nothing in them is code. The columns of a CSV are

    time, state, position, velocity, acceleration, feedback, input, value

A line has either what the axis did in a cycle (all but the last two) or what an input did there
(time, position, input, value); what is known of the run stands above them, after `#`, as JSON.
Times in s, positions raw in m or rad.
"""

import csv
import json
import zipfile
from collections.abc import Iterator, Mapping
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.outcome import Outcome
from ..course import Course, Happening, Sample
from ..procedures.events import Event
from ..procedures.states import LATCHES, Error, Input, State
from ..procedures.steps import Step

FORMAT = 'homing course 1'
#: Of a position: a linear axis, a rotary one.
UNITS = ('m', 'rad')
COLUMNS = (*Sample._fields, 'input', 'value')
REALS = ('time', 'position', 'velocity', 'acceleration', 'feedback')


class InvalidRecord(ValueError):
    """A file that holds no course; the message names the file and what is wrong."""


class Record(NamedTuple):
    """A course and what it is of; ``unit`` is that of a position, m or rad."""

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
        samples, happenings = course.samples, course.happenings
        with path.open('wb') as file:
            np.savez_compressed(
                file,
                allow_pickle=False,
                about=np.array(json.dumps(_about(course, title, unit))),
                state=np.array([sample.state for sample in samples], dtype=np.str_),
                input=np.array([each.input for each in happenings], dtype=np.str_),
                happenings=np.array(
                    [(each.time, float(each.value), each.position) for each in happenings],
                    dtype=float,
                ).reshape(-1, 3),
                **{
                    name: np.array([getattr(sample, name) for sample in samples], dtype=float)
                    for name in REALS
                },
            )
    else:
        raise ValueError(f'{path}: a course is saved as .npz or .csv')


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
    return {
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


def _course(about: Mapping[str, Any], samples: list[Sample], found: list[Happening]) -> Record:
    if about.get('format') != FORMAT:
        raise ValueError(f'it says {about.get("format")!r}, not {FORMAT!r}')
    unit = about.get('unit', 'm')
    if unit not in UNITS:
        raise ValueError(f'the unit {unit!r} is none of {", ".join(UNITS)}')
    told = about['outcome']
    outcome = told and Outcome(
        **{**told, 'error': Error(told['error']), 'warnings': tuple(told.get('warnings', ()))}
    )
    arrows = [(Step(State(state), phase), Event(event)) for state, phase, event in about['arrows']]
    return Record(Course(samples, found, outcome, arrows), about['title'], unit)


def _happening(time: float, name: str, value: float, position: float) -> Happening:
    latch = Input(name) in LATCHES
    return Happening(time, name, value if latch else bool(value), position)


def _from_arrays(file: Mapping[str, Any]) -> Record:
    states = [str(state) for state in file['state']]
    columns = [file[name].tolist() for name in REALS]
    samples = [
        Sample(time, state, *rest) for state, time, *rest in zip(states, *columns, strict=True)
    ]
    found = [
        _happening(time, str(name), value, position)
        for name, (time, value, position) in zip(
            file['input'], file['happenings'].tolist(), strict=True
        )
    ]
    return _course(json.loads(str(file['about'])), samples, found)


def _csv(course: Course, title: str, unit: str) -> str:
    text = StringIO()
    for name, value in _about(course, title, unit).items():
        text.write(f'# {name}: {json.dumps(value)}\n')
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(COLUMNS)
    rows: list[tuple[float, list[object]]] = [
        (sample.time, [*sample, '', '']) for sample in course.samples
    ]
    rows += [
        (each.time, [each.time, '', each.position, '', '', '', each.input, float(each.value)])
        for each in course.happenings
    ]
    rows.sort(key=lambda row: row[0])
    writer.writerows(
        [repr(cell) if isinstance(cell, float) else cell for cell in row] for _, row in rows
    )
    return text.getvalue()


def _from_csv(text: str) -> Record:
    lines = text.splitlines()
    head = [line for line in lines if line.startswith('#')]
    about = {
        name.strip('# '): json.loads(value)
        for name, _, value in (line.partition(': ') for line in head)
    }
    samples: list[Sample] = []
    found: list[Happening] = []
    for number, row in _rows(lines, len(head)):
        try:
            if row['input']:
                found.append(
                    _happening(
                        float(row['time']),
                        row['input'],
                        float(row['value']),
                        float(row['position']),
                    )
                )
            else:
                reals = {name: float(row[name]) for name in REALS}
                samples.append(Sample(state=row['state'], **reals))
        except (TypeError, ValueError) as error:
            raise ValueError(f'line {number}: {error}') from None
    return _course(about, samples, found)


def _rows(lines: list[str], skip: int) -> Iterator[tuple[int, dict[str, str]]]:
    reader = csv.DictReader(lines[skip:])
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise ValueError(f'the columns are not {", ".join(COLUMNS)}')
    for row in reader:
        yield skip + reader.line_num, row
