# SPDX-License-Identifier: Apache-2.0
"""The pictures: what they show, that nothing in them covers a name, and their files."""

from collections.abc import Collection
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from core_rig import thinned
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from homing_node.core.outcome import Outcome
from homing_node.course import Course, Sample
from homing_node.figures.plot import POSITION_DIAGRAM, PROFILE, Panel, figure, save
from homing_node.plant.layout import AxisLayout
from homing_node.procedures.states import Error, HomeType, Input, State
from homing_node.rehearsal.examples import BEYOND, EXAMPLES, Run
from homing_node.rehearsal.run import rehearse

HSHS = EXAMPLES[HomeType.HSHS]
STEP = 0.02
EVERY_RUN = [
    pytest.param(
        home_type,
        run,
        id=f'{home_type}-{run.title}',
        marks=[pytest.mark.long] if number or n % 5 else [],  # drawing takes half a second
    )
    for n, (home_type, example) in enumerate(EXAMPLES.items())
    for number, run in enumerate(example.runs)
]


def texts(drawn: Figure) -> list[Text]:
    return [each for each in drawn.findobj(Text) if each.get_text() and each.get_visible()]


def words(drawn: Figure) -> list[str]:
    return [each.get_text() for each in texts(drawn)]


def extents(drawn: Figure) -> list[tuple[str, Bbox]]:
    drawn.draw_without_rendering()
    return [(each.get_text(), each.get_window_extent()) for each in texts(drawn)]


def apart(drawn: Figure, names: Collection[str]) -> bool:
    boxes = [box for word, box in extents(drawn) if word in names]
    return not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def course(*stretches: tuple[State, float], outcome: Outcome | None = None) -> Course:
    """Give a course that goes on at 10 mm/s through home states of these durations, s."""
    samples, time = [], 0.0
    for state, duration in stretches:
        for _ in range(max(1, round(duration / STEP))):
            samples.append(Sample(time, str(state), 0.01 * time, 0.01, 0.0, 0.01 * time))
            time += STEP
    return Course(samples, outcome=outcome)


@pytest.mark.parametrize('home_type, run', EVERY_RUN)
def test_every_example_homes_and_is_named(home_type: HomeType, run: Run) -> None:
    example = EXAMPLES[home_type]
    made = example.rehearse(run)
    assert made.outcome is not None and made.outcome.success, made.outcome
    drawn = figure(made, example.layout, f'{home_type}, {run.title}')
    states = [state for state in made.states if state != State.Idle]
    assert [word for word in words(drawn) if word in set(State)] == states
    assert f'home {1e3 * made.outcome.home_position_raw:.3f} mm' in words(drawn)
    named = extents(drawn)
    assert not any(
        a.overlaps(b) for (v, a), (w, b) in combinations(named, 2) if v in states and w in states
    )
    assert all(
        drawn.bbox.x0 <= box.x0
        and box.x1 <= drawn.bbox.x1
        and drawn.bbox.y0 <= box.y0
        and box.y1 <= drawn.bbox.y1
        for _, box in named
    )


def test_switches_are_named_apart() -> None:
    drawn = figure(HSHS.rehearse(BEYOND), HSHS.layout)
    names = [
        'hard stop',
        'positive limit',
        'negative limit',
        'home switch',
        'start',
        'home 70.000 mm',
    ]
    assert set(names) <= set(words(drawn))
    assert apart(drawn, names)


@settings(max_examples=10, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(list(State)[1:]), st.floats(STEP, 0.5)), min_size=1, max_size=12
    )
)
def test_names_of_short_states_never_cover_each_other(
    stretches: list[tuple[State, float]],
) -> None:
    made = course(*stretches)
    drawn = figure(made, panels=(Panel.VELOCITY,))
    assert [word for word in words(drawn) if word in set(State)] == made.states
    assert apart(drawn, made.states)


def test_panels() -> None:
    made = HSHS.rehearse(BEYOND)
    assert [axes.get_ylabel() for axes in figure(made, panels=POSITION_DIAGRAM).axes] == [
        '',
        'position in mm',
    ]
    assert [axes.get_ylabel() for axes in figure(made, panels=PROFILE).axes] == [
        '',
        'velocity\ncommand\nin mm/s',
        'acceleration\ncommand\nin mm/s²',
    ]


@pytest.mark.parametrize(
    'stroke, unit, shown',
    [(0.3, 'm', 'mm'), (3.0, 'm', 'm'), (3.0, 'rad', 'rad'), (0.3, 'rad', 'rad')],
)
def test_units(stroke: float, unit: str, shown: str) -> None:
    made = course((State.HSSearch, 0.1))
    layout = AxisLayout((0.0, stroke), {})
    made.samples[-1] = made.samples[-1]._replace(feedback=stroke)
    drawn = figure(made, layout, unit=unit)
    assert drawn.axes[1].get_ylabel() == f'position in {shown}'


def test_a_run_that_failed_shows_where_and_why() -> None:
    short = replace(HSHS.parameters, max_ls_reverse_distance=0.03)
    failed = rehearse(short, HSHS.layout, position=BEYOND.start)
    drawn = figure(failed, HSHS.layout)
    assert 'MaxLSRevDistanceTraveled' in words(drawn)
    assert not [word for word in words(drawn) if word.startswith('home 7')]


def test_without_motion() -> None:
    nothing = Course(outcome=Outcome(Error.Busy, 'homing is in progress'))
    assert 'no motion' in words(figure(nothing))
    assert 'no motion' in words(figure(nothing, HSHS.layout))


def test_without_a_layout_the_edges_of_the_course_are_shown() -> None:
    drawn = figure(HSHS.rehearse(BEYOND))
    assert 'switch turns on' in words(drawn)
    assert 'hard stop' not in words(drawn)


def test_hard_stops_may_be_unknown() -> None:
    unknown = HSHS.layout._replace(hard_stops=(-float('inf'), float('inf')))
    assert 'positive limit' in words(figure(HSHS.rehearse(BEYOND), unknown))


@pytest.mark.parametrize('suffix', thinned(['svg', 'png', 'pdf'], 3))
def test_the_same_course_gives_the_same_file(tmp_path: Path, suffix: str) -> None:
    paths = [tmp_path / f'{n}.{suffix}' for n in range(2)]
    for path in paths:
        save(path, HSHS.rehearse(BEYOND), HSHS.layout, 'HSHS')
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_an_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='xyz'):
        save(tmp_path / 'course.xyz', HSHS.rehearse(BEYOND))


def long_axis(pitch: float = 0.0) -> tuple[Course, AxisLayout]:
    """Return the run of an axis of 3 m, whose home switch is 12 mm wide."""
    flags = {
        'home_switch': HSHS.layout.switches['home_switch']._replace(on_from=2.5, on_to=2.512),
        'positive_limit_switch': HSHS.layout.switches['positive_limit_switch']._replace(
            on_from=2.9, on_to=4.0
        ),
    }
    layout = HSHS.layout._replace(
        hard_stops=(0.0, 3.0), switches=flags, index_pitch=pitch, index_offset=0.003
    )
    fast = replace(
        HSHS.parameters,
        travel=3.0,
        homing_velocity_fast=0.2,
        homing_velocity_fast_acc=1.0,
        homing_velocity_fast_dec=1.0,
        homing_reverse_distance=0.002,
        switches=(Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH),
    )
    return rehearse(fast, layout, position=1.5), layout


def test_a_long_axis_is_shown_closely_where_it_homes() -> None:
    made, layout = long_axis(pitch=0.01)
    drawn = figure(made, layout)
    whole, close = drawn.axes[1:3]
    assert (whole.get_ylabel(), close.get_ylabel()) == ('position in m', 'from home\nin mm')
    low, high = close.get_ylim()
    assert -80.0 < low < -12.0 < 12.0 < high < 80.0  # the whole switch, and the turns around it
    assert words(drawn).count('home switch') == 2 and 'home 2.500000 m' in words(drawn)
    assert all(box.x0 >= 0.0 and box.x1 <= drawn.bbox.x1 for _, box in extents(drawn))
    assert len(figure(HSHS.rehearse(BEYOND), HSHS.layout).axes) == len(drawn.axes) - 1


@pytest.mark.parametrize(
    'pitch, said',
    [(0.5, 'index mark'), (0.1, 'each 2nd index mark'), (0.001, 'each 200th index mark')],
)
def test_index_marks_are_thinned(pitch: float, said: str) -> None:
    made, layout = long_axis(pitch)
    drawn = figure(made, layout, panels=POSITION_DIAGRAM)
    assert said in words(drawn)
    assert len(drawn.axes[1].lines) < 40


def test_command_and_feedback_are_both_named() -> None:
    made = HSHS.rehearse(BEYOND)
    assert 'feedback, command' in words(figure(made, HSHS.layout))
    behind = [one._replace(feedback=one.position - 0.02) for one in made.samples]
    named = words(figure(replace(made, samples=behind), HSHS.layout))
    assert {'feedback', 'command'} <= set(named)


@pytest.mark.parametrize('layout', [HSHS.layout, None], ids=['layout', 'none'])
def test_the_margins_are_as_wide_as_what_stands_there(layout: AxisLayout | None) -> None:
    """No quarter of the width is empty; all texts are on the sheet (the test of every example)."""
    drawn = figure(HSHS.rehearse(BEYOND), layout)
    boxes = [box for _, box in extents(drawn)]
    wide = drawn.bbox.width
    assert min(box.x0 for box in boxes) < 0.06 * wide
    assert max(box.x1 for box in boxes) > 0.94 * wide
    panel = drawn.axes[1].get_window_extent()
    assert panel.width > 0.7 * wide
