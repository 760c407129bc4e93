# SPDX-License-Identifier: Apache-2.0
"""The state diagrams say what the tables say, and so do the committed pages."""

import importlib.util
import re
from collections import Counter
from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from homing_node.figures.diagram import arrows, bounds, boxes, mermaid
from homing_node.figures.diagram_svg import svg
from homing_node.figures.plot import figure
from homing_node.procedures.motions import Kind
from homing_node.procedures.procedure import Procedure
from homing_node.procedures.states import HomeType, State
from homing_node.procedures.steps import HOMED
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.examples import EXAMPLES

ROOT = Path(__file__).resolve().parent.parent
TYPES = ROOT / 'doc' / 'types'
every_type = pytest.mark.parametrize(
    'procedure', PROCEDURES.values(), ids=[str(home_type) for home_type in PROCEDURES]
)
#: Drawing takes half a second: make test draws every fifth type, make test-long the others.
some_types = pytest.mark.parametrize(
    'procedure',
    [
        pytest.param(procedure, marks=[pytest.mark.long] if n % 5 else [])
        for n, procedure in enumerate(PROCEDURES.values())
    ],
    ids=[str(home_type) for home_type in PROCEDURES],
)


@every_type
def test_every_row_stands_in_one_box(procedure: Procedure) -> None:
    steps = [step for box in boxes(procedure) for step in box.steps]
    assert sorted(steps) == sorted(procedure.rows)
    assert all(step.state is box.steps[0].state for box in boxes(procedure) for step in box.steps)


@every_type
def test_names_and_titles_are_unique(procedure: Procedure) -> None:
    assert len({box.name for box in boxes(procedure)}) == len(boxes(procedure))
    assert len({box.title for box in boxes(procedure)}) == len(boxes(procedure))


@every_type
def test_boxes_are_entered_at_their_first_row(procedure: Procedure) -> None:
    box_of = {step: box for box in boxes(procedure) for step in box.steps}
    for step, row in procedure.rows.items():
        for target in row.on.values():
            if target is not HOMED and box_of[target] != box_of[step]:
                assert target == box_of[target].steps[0]


@every_type
def test_an_event_leads_out_of_a_box_to_one_place(procedure: Procedure) -> None:
    assert not [
        key
        for key, count in Counter(
            (arrow.source, arrow.label) for arrow in arrows(procedure)
        ).items()
        if count > 1
    ]


@every_type
def test_every_search_has_its_error(procedure: Procedure) -> None:
    failing = {arrow.source for arrow in bounds(procedure)}
    for box in boxes(procedure):
        searches = [
            procedure.rows[s] for s in box.steps if procedure.rows[s].motion.kind is Kind.SEARCH
        ]
        assert (box.name in failing) == bool(searches)


@every_type
def test_mermaid_has_every_arrow_of_the_table(procedure: Procedure) -> None:
    text = mermaid(procedure)
    labels = Counter(re.findall(r'-->.* : (.*)', text))
    inner = Counter(
        str(event)
        for box in boxes(procedure)
        for step in box.steps
        for event, target in procedure.rows[step].on.items()
        if target in box.steps
    )
    outer = Counter(arrow.label for arrow in (*arrows(procedure), *bounds(procedure)))
    assert labels == inner + outer
    assert text.count('{') == text.count('}')
    declared = set(re.findall(r' as (\w+)', text)) | set(re.findall(r'class (\w+) error', text))
    named = {name for pair in re.findall(r'(\S+) --> (\S+)', text) for name in pair}
    assert named - {'[*]'} == declared


def test_mermaid_as_it_is_written() -> None:
    assert (
        mermaid(PROCEDURES[HomeType.TouchProbe])
        == """\
stateDiagram-v2
    [*] --> TouchProbeSearch
    state "TouchProbeSearch<br>toward, slow" as TouchProbeSearch
    state "HomeShift" as HomeShift {
        state "come to rest" as HomeShift_1
        state "to the home position + home shift" as HomeShift_2
        [*] --> HomeShift_1
        HomeShift_1 --> HomeShift_2 : done
    }
    state "homed" as Homed
    TouchProbeSearch --> HomeShift : touch probe
    HomeShift --> Homed : done
    TouchProbeSearch --> SearchDistanceExceeded : max_search_distance
    Homed --> [*]
    classDef error fill:#fbe3d6,stroke:#d55e00,color:#7a3000
    class SearchDistanceExceeded error
"""
    )


def test_mermaid_of_some_states_only() -> None:
    text = mermaid(PROCEDURES[HomeType.HSHS], (State.HSSearch, State.HSFallingEdgeSearchReverse))
    assert 'HSSearch --> HSFallingEdgeSearchReverse : limit ahead' in text
    assert 'HSFallingEdgeSearchReverse --> HSSearch : done' in text
    assert 'HSFallingEdgeSearchReverse --> MaxLSRevDistanceTraveled' in text
    assert 'HomeShift' not in text
    assert 'Homed' not in text


@every_type
def test_svg_says_the_same(procedure: Procedure) -> None:
    texts = Counter(_texts(svg(procedure)))
    for box in boxes(procedure):
        assert texts[box.title] == 1
    outer = Counter(arrow.label for arrow in arrows(procedure))
    assert all(texts[label] >= count for label, count in outer.items())
    for arrow in bounds(procedure):
        assert texts[arrow.target] >= 1
        assert texts[f'beyond {arrow.label}:'] >= 1


@every_type
def test_boxes_do_not_overlap_in_svg(procedure: Procedure) -> None:
    drawn = ElementTree.fromstring(svg(procedure))
    frames = [
        tuple(float(each.attrib[key]) for key in ('x', 'y', 'width', 'height'))
        for each in drawn.iter('{http://www.w3.org/2000/svg}rect')
        if each.get('rx') == '6' and each.get('fill') == 'none'
    ]
    assert len(frames) == len(boxes(procedure))
    for (x, y, width, height), (u, v, wide, tall) in combinations(frames, 2):
        assert x + width <= u or u + wide <= x or y + height <= v or v + tall <= y


@every_type
def test_no_label_covers_another_one_or_an_arrow(procedure: Procedure) -> None:
    drawn = ElementTree.fromstring(svg(procedure))
    labels = [_extent(each) for each in drawn.iter('{http://www.w3.org/2000/svg}text')]
    for (one, a), (other, b) in combinations(labels, 2):
        assert not _overlap(a, b), (one, other)
    for path in drawn.iter('{http://www.w3.org/2000/svg}path'):
        if path.get('marker-end'):
            numbers = [float(number) for number in path.attrib['d'][1:].split()]
            points = list(zip(numbers[::2], numbers[1::2], strict=True))
            for (x, y), (u, v) in pairwise(points):
                for text, extent in labels:
                    assert not _overlap(extent, (min(x, u), min(y, v), max(x, u), max(y, v))), text


def _extent(text: ElementTree.Element) -> tuple[str, tuple[float, float, float, float]]:
    """Return a text, and its left, top, right and bottom; letters are 0.6 of their size wide."""
    x, y, size = (float(text.attrib[key]) for key in ('x', 'y', 'font-size'))
    words = text.text or ''
    width = 0.6 * size * len(words)
    left = x - {'start': 0.0, 'middle': width / 2, 'end': width}[text.attrib['text-anchor']]
    return words, (left, y - 0.75 * size, left + width, y + 0.2 * size)


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _texts(document: str) -> list[str]:
    drawn = ElementTree.fromstring(document)
    return [each.text or '' for each in drawn.iter('{http://www.w3.org/2000/svg}text')]


# ------------------------------------------------------------------------- the committed pages


@every_type
def test_page_shows_the_table_as_it_is(procedure: Procedure) -> None:
    page = (TYPES / f'{procedure.home_type}.md').read_text()
    assert f'```mermaid\n{mermaid(procedure)}```\n' in page, 'run make docs'
    assert f'\n\n{procedure.words}\n\n' in page, 'run make docs'
    assert f'\n| Home position | {procedure.home} |\n' in page, 'run make docs'


@pytest.fixture(scope='module')
def docs():
    """The script that makes the pages."""
    spec = importlib.util.spec_from_file_location('docs', ROOT / 'scripts' / 'docs.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@some_types
def test_a_figure_shows_the_run_as_it_is(docs, procedure: Procedure) -> None:
    """One run of each type, in turn another one: all are drawn by the same code."""
    home_type = procedure.home_type
    example = EXAMPLES[home_type]
    run = example.runs[list(PROCEDURES).index(home_type) % len(example.runs)]
    drawn = figure(example.rehearse(run), example.layout, f'{home_type}, {run.title}')
    name = f'{home_type}_{run.title}.svg'.replace(' ', '_').replace(',', '')
    committed = (TYPES / 'figures' / name).read_text()
    assert docs.small_svg(drawn) == committed, 'run make docs'
    assert ElementTree.fromstring(committed).tag == '{http://www.w3.org/2000/svg}svg'


def test_page_on_limit_switches_shows_the_table_as_it_is() -> None:
    page = (TYPES / 'limit_switches_during_homing.md').read_text()
    states = (State.HSSearch, State.HSFallingEdgeSearchReverse)
    diagram = mermaid(PROCEDURES[HomeType.HSHS], states)
    assert f'```mermaid\n{diagram}```\n' in page, 'run make docs'


def test_what_the_pages_link_is_there() -> None:
    linked = set()
    for page in TYPES.glob('*.md'):
        for target in re.findall(r'\]\(([^)#]+)\)', page.read_text()):
            assert (TYPES / target).is_file(), f'{page.name}: {target}'
            linked.add(target)
    figures = {f'figures/{figure.name}' for figure in (TYPES / 'figures').iterdir()}
    assert figures <= linked


def test_figures_are_small() -> None:
    sizes = [figure.stat().st_size for figure in (TYPES / 'figures').iterdir()]
    assert max(sizes) <= 60_000
    assert sum(sizes) <= 3_000_000
