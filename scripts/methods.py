# SPDX-License-Identifier: Apache-2.0
"""Makes doc/cia402.md with its figures, and doc/convert.md, from the tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from homing_node.convert import KINDS
from homing_node.figures.palette import BLUE, DARK_VERMILLION, GREEN, GREY, INK, VERMILLION
from homing_node.parameters.axis import AxisParameters, axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.plant.timing import Timing
from homing_node.procedures.cia402 import METHODS, Method
from homing_node.procedures.states import LIMIT_SWITCHES, Input, Role
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.sweep import Trial, starts, sweep, transport_of

ROOT = Path(__file__).resolve().parent.parent
DOC = ROOT / 'doc'
FIGURES = DOC / 'figures'

NOTICE = '<!-- Made by `make docs` from scripts/methods.py. -->'

CIA402 = """\
{notice}

# Home types by the number of CiA 402

Who comes from a drive's manual knows a homing method by its number (object 0x6098). `home_type`
takes it: `home_type: 17`, or `'CiA402 17'`. The number implies the direction; a `home_direction`
that contradicts it is an error. State and results show the name of the table. `homing types`
lists the numbers, `homing explain 17` tells one.

+ and - are the positive and the negative direction. The home types' pages show their state
diagrams.

| method | first motion of the standard | home | `home_type` | `home_direction` | reversal |
|---|---|---|---|---|---|
{rows}

Methods 15, 16, 31 and 32 are reserved; 36 and the negative numbers, which are the drive makers'
own, have no alias. See `TouchProbe` and the mechanical end types.

## Differences to the standard

{differences}

Everywhere the node's bounds, limits, errors and the uncertainty are around the method: a search
ends after `max_search_distance`, a run after `timeout`, and `home_shift_distance` follows.

## From every start

A picture for each family: the time of a run over the place where it starts, from one hard stop to
the other. The bands are the switches, the line is home. They are rehearsed: `make docs`.

{figures}

## Where a number's speed and acceleration stand

| object | here |
|---|---|
| 0x6098 | `home_type` |
| 0x6099:1 | `homing_velocity_fast` |
| 0x6099:2 | `homing_velocity_slow` |
| 0x609A | `homing_velocity_fast_acc`, `homing_velocity_fast_dec` and those of `slow` |
| 0x607C | `home_position` |
"""

CONVERT = """\
{notice}

# Other controllers' files

```bash
homing convert machine.ini -o axes.yaml
homing check axes.yaml
```

reads the homing of another controller and writes it as a parameter file. The kind of file is
recognised; an unknown one is named. Each value has the line that it comes from as its comment, and
what has no equal here stands as a comment, too. An axis that cannot be converted says why. Where a
file has no travel, `--travel` gives one. Lengths become m, angles rad. No controller here has a
jerk limit: `max_jerk` is chosen so that the acceleration is reached within 0.05 s.

What no file tells: the places of the switches (a layout for `homing check --layout`), their
topics, and which limit switches there are.

{kinds}"""


class Family(NamedTuple):
    """Methods that are drawn together: a title, their numbers, what the home switch covers."""

    name: str
    title: str
    numbers: Sequence[int]
    home_switch: tuple[float, float] | None


MOMENTARY, HIGH_END, LOW_END = (0.042, 0.056), (0.060, 1.0), (-1.0, 0.040)
FAMILIES = (
    Family('limit_index', 'limit switch, then index', (1, 2), None),
    Family('wide_index_positive', 'home switch at the positive end, index', (3, 4), HIGH_END),
    Family('wide_index_negative', 'home switch at the negative end, index', (5, 6), LOW_END),
    Family('momentary_index', 'momentary home switch, index', range(7, 15), MOMENTARY),
    Family('limit', 'limit switch', (17, 18), None),
    Family('wide_positive', 'home switch at the positive end', (19, 20), HIGH_END),
    Family('wide_negative', 'home switch at the negative end', (21, 22), LOW_END),
    Family('momentary', 'momentary home switch', range(23, 31), MOMENTARY),
    Family('index', 'the next index', (33, 34), None),
)
LIMITS = {
    'negative_limit_switch': SwitchLayout(-1.0, 0.010, 0.0003),
    'positive_limit_switch': SwitchLayout(0.090, 1.0, 0.0003),
}
STARTS = 41
WIDTH, HEIGHT, GAP = 300, 92, 26


def parameters_and_layout(number: int, family: Family) -> tuple[AxisParameters, AxisLayout]:
    """Return the axis on which a method is shown."""
    flags = dict(LIMITS)
    if family.home_switch:
        flags['home_switch'] = SwitchLayout(*family.home_switch, 0.0003)
    indexed = number < 15 or number > 32
    layout = AxisLayout(
        (0.0, 0.1), flags, index_pitch=0.01 if indexed else 0.0, index_offset=0.0027, lag=0.004
    )
    values = {
        'home_type': number,
        'travel': 0.1,
        'homing_reverse_distance': 0.002,
        'switches': [*flags, *(['z_pulse'] if indexed else [])],
    }
    return axis_parameters(values), layout


def picture(family: Family) -> str:
    """Return the SVG of a family: a panel for each method, two beside each other."""
    panels = []
    for n, number in enumerate(family.numbers):
        parameters, layout = parameters_and_layout(number, family)
        positions = starts(parameters, layout, STARTS)
        trials = list(sweep(parameters, layout, transport_of(Timing()), positions))
        x, y = 12 + n % 2 * (WIDTH + GAP), 34 + n // 2 * (HEIGHT + 2 * GAP)
        panels.append(_panel(METHODS[number], trials, layout, x, y))
    rows = (len(family.numbers) + 1) // 2
    width, height = 2 * WIDTH + GAP + 24, 34 + rows * (HEIGHT + 2 * GAP)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="sans-serif" font-size="11">\n'
        f'<rect width="{width}" height="{height}" fill="white"/>\n' + ''.join(panels) + '</svg>\n'
    )


def _panel(method: Method, trials: Sequence[Trial], layout: AxisLayout, x: int, y: int) -> str:
    low, high = layout.hard_stops
    longest = max(trial.course.duration for trial in trials) or 1.0

    def across(position: float) -> float:
        return round(x + WIDTH * (min(max(position, low), high) - low) / (high - low), 1)

    def up(time: float) -> float:
        return round(y + HEIGHT * (1.0 - 0.92 * time / longest), 1)

    parts = [
        f'<text x="{x}" y="{y - 8}" fill="{INK}" font-weight="bold">{method.number} '
        f'{method.home_type} {method.direction}</text>\n',
        f'<text x="{x + WIDTH}" y="{y - 8}" fill="{INK}" text-anchor="end">0 to '
        f'{longest:.1f} s</text>\n',
    ]
    for name, flag in layout.switches.items():
        left, right = across(flag.on_from), across(flag.on_to)
        colour = DARK_VERMILLION if Input(name) in LIMIT_SWITCHES else BLUE
        parts.append(
            f'<rect x="{left}" y="{y}" width="{round(right - left, 1)}" height="{HEIGHT}" '
            f'fill="{colour}" fill-opacity="0.16"/>\n'
        )
    homes = {trial.course.outcome.home_position_raw for trial in trials if trial.success}
    if max(homes, default=0.0) - min(homes, default=0.0) < 1e-3:
        for home in list(homes)[:1]:
            at = across(home)
            parts.append(
                f'<line x1="{at}" x2="{at}" y1="{y}" y2="{y + HEIGHT}" stroke="{INK}" '
                'stroke-dasharray="3 2"/>\n'
            )
    points = ' '.join(f'{across(t.start)},{up(t.course.duration)}' for t in trials)
    parts.append(f'<polyline points="{points}" fill="none" stroke="{GREY}"/>\n')
    for trial in trials:
        colour = GREEN if trial.success else VERMILLION
        parts.append(
            f'<circle cx="{across(trial.start)}" cy="{up(trial.course.duration)}" r="2.4" '
            f'fill="{colour}"/>\n'
        )
    parts.append(
        f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="{GREY}"/>\n'
    )
    failed = sum(not trial.success for trial in trials)
    told = f'{len(trials) - failed} of {len(trials)} starts home'
    parts.append(f'<text x="{x}" y="{y + HEIGHT + 14}" fill="{INK}">{told}</text>\n')
    return ''.join(parts)


def cia402_page() -> str:
    """Return doc/cia402.md."""
    rows = []
    for number, one in METHODS.items():
        turns = Role.REVERSAL in PROCEDURES[one.home_type].limits_ahead.values()
        reversal = '' if not turns else 'yes' if one.limit_reversal else 'no'
        rows.append(
            f'| {number} | {one.motion} | {one.home} | '
            f'[{one.home_type}](types/{one.home_type}.md) | {one.direction or ""} | {reversal} |'
        )
    by_text: dict[str, list[int]] = {}
    for number, one in METHODS.items():
        for difference in one.differences:
            by_text.setdefault(difference, []).append(number)
    differences = [
        f'- {", ".join(map(str, numbers))}: {text}.' for text, numbers in by_text.items()
    ]
    figures = [
        f'### {family.title.capitalize()}\n\n![Runs of methods '
        f'{family.numbers[0]} to {family.numbers[-1]} from every start]'
        f'(figures/cia402_{family.name}.svg)'
        for family in FAMILIES
    ]
    return CIA402.format(
        notice=NOTICE,
        rows='\n'.join(rows),
        differences='\n'.join(differences),
        figures='\n\n'.join(figures),
    )


def convert_page() -> str:
    """Return doc/convert.md."""
    kinds = []
    for kind, module in KINDS.items():
        rows = '\n'.join(
            f'| `{row.source}` | {_ours(row.ours)} | {row.text} |' for row in module.TABLE
        )
        kinds.append(f'## {kind}\n\n| there | here | |\n|---|---|---|\n{rows}\n')
    return CONVERT.format(notice=NOTICE, kinds='\n'.join(kinds))


def _ours(names: str) -> str:
    return ', '.join(f'`{name}`' for name in names.split(', ')) if names else 'no equal'


def main() -> None:
    FIGURES.mkdir(exist_ok=True)
    (DOC / 'cia402.md').write_text(cia402_page())
    (DOC / 'convert.md').write_text(convert_page())
    for family in FAMILIES:
        (FIGURES / f'cia402_{family.name}.svg').write_text(picture(family))


if __name__ == '__main__':
    main()
