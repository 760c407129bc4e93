# SPDX-License-Identifier: Apache-2.0
"""Makes doc/types: a page for every home type, from the tables and from rehearsed runs."""

import re
from dataclasses import replace
from io import StringIO
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from homing_node.figures.diagram import mermaid
from homing_node.figures.plot import POSITION_DIAGRAM, PROFILE, figure
from homing_node.procedures import cia402
from homing_node.procedures.procedure import Procedure
from homing_node.procedures.states import HomeType, LimitPair, State
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.examples import BEYOND, EXAMPLES
from homing_node.rehearsal.run import rehearse

ROOT = Path(__file__).resolve().parent.parent
TYPES = ROOT / 'doc' / 'types'
FIGURES = TYPES / 'figures'

LIMITS_PAGE = 'limit_switches_during_homing'

#: A length in an SVG, but no opacity.
LENGTH = re.compile(r'(?<!opacity: )-?\d+\.\d+')

NOTICE = '<!-- Made by `make docs` from scripts/docs.py and homing_node/procedures. -->'

PAGE = """\
{notice}

# {home_type}

*Toward* is along the homing direction, *away* against it.

{words}

| | |
|---|---|
| Home position | {home} |
| Needs | {needs} |
| A limit switch ahead | {ahead} |
| A limit switch behind | normal |
| [CiA 402](../cia402.md) | {methods} |

[Limit switches during homing]({limits_page}.md) tells what these words mean.

## State diagram

What holds in every state (a normal limit switch, cancel, the timeout, lost feedback …) is not
drawn.

```mermaid
{diagram}```
{runs}"""

RUN = """
## A run {title}

![Position, velocity and acceleration of {home_type}, {title}](figures/{file})
"""

INDEX = """\
{notice}

# Home types

A page each: what the axis does, its state diagram, and what a run looks like. The diagrams are
drawn from the tables that the node executes, the figures from rehearsed runs of the same code.
[Limit switches during homing]({limits_page}.md) tells what limit switches do
meanwhile.

| `home_type` | [CiA 402](../cia402.md) | the home position is | needs |
|---|---|---|---|
{rows}
"""

LIMITS = """\
{notice}

# Limit switches during homing

During homing, what a limit switch does depends on the home type and on its side. *Ahead* is the
end toward which the axis homes, *behind* the other one.

| home types | hardware limit ahead | near limit ahead | external limit ahead | behind |
|---|---|---|---|---|
{rows}

- **normal**: the action of its LS Type, on the rising edge, while the axis moves toward that
  limit. The run ends with `LSTriggered`.
- **reference**: the switch on which the axis homes.
- **ignored**: nothing at all.
- **reversal**: what the rest of this page shows, for `HSHS`.

## The reversal

When the home switch lies behind the axis, the axis meets the limit switch ahead instead. It turns
there, goes away until the home switch falls, goes on by `homing_reverse_distance`, and begins the
home type's procedure again. A limit switch that is on at the start is left in the same way,
without a step toward it.

There is one reversal in a run: a second limit switch ahead ends it with `LSTriggered`. The way
back is bounded by `max_ls_reverse_distance`. With `immediate_stop_at_ls` the command stops at the
edge of the limit switch at once, before the axis turns.

### State diagram

The procedure from the search on, as `HSHS` has it; [HSHS](HSHS.md) has the whole.

```mermaid
{diagram}```

### Position diagram

![Position diagram of HSHS meeting the limit switch](figures/{position})

### Profile

![Velocity and acceleration of HSHS meeting the limit switch](figures/{profile})

### The home switch does not fall

With `max_ls_reverse_distance` = {bound:g} mm, too short for this axis, the same run ends with
`MaxLSRevDistanceTraveled`. The axis stops with `ls_dec` and is not homed.

![Position, velocity and acceleration of the run that fails](figures/{failure})
"""


def main() -> None:
    FIGURES.mkdir(parents=True, exist_ok=True)
    for old in (*TYPES.glob('*.md'), *FIGURES.iterdir()):
        old.unlink()
    for procedure in PROCEDURES.values():
        (TYPES / f'{procedure.home_type}.md').write_text(page(procedure))
    (TYPES / 'README.md').write_text(index())
    (TYPES / f'{LIMITS_PAGE}.md').write_text(limits_page())


def page(procedure: Procedure) -> str:
    """Return the page of a home type; make its figures."""
    home_type = procedure.home_type
    example = EXAMPLES[home_type]
    runs = []
    for run in example.runs:
        drawn = figure(example.rehearse(run), example.layout, f'{home_type}, {run.title}')
        file = save(drawn, f'{home_type}_{run.title}')
        runs.append(RUN.format(title=run.title, home_type=home_type, file=file))
    return PAGE.format(
        notice=NOTICE,
        home_type=home_type,
        words=procedure.words,
        home=procedure.home,
        needs=needs(procedure),
        methods=', '.join(map(str, cia402.numbers_of(home_type))) or 'no method',
        ahead=ahead(procedure),
        limits_page=LIMITS_PAGE,
        diagram=mermaid(procedure),
        runs=''.join(runs),
    )


def index() -> str:
    """Return the page that lists all home types."""
    rows = (
        f'| [{t}]({t}.md) | {", ".join(map(str, cia402.numbers_of(t)))} | {p.home} | {needs(p)} |'
        for t, p in PROCEDURES.items()
    )
    return INDEX.format(notice=NOTICE, limits_page=LIMITS_PAGE, rows='\n'.join(rows))


def limits_page() -> str:
    """Return the page that answers the manual's, picture for picture; make its figures."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for home_type, procedure in PROCEDURES.items():
        roles = tuple(procedure.limits_ahead[pair] for pair in LimitPair)
        groups.setdefault(roles, []).append(f'`{home_type}`')
    rows = [
        f'| {", ".join(types)} | {" | ".join(roles)} | normal |' for roles, types in groups.items()
    ]
    example = EXAMPLES[HomeType.HSHS]
    course = example.rehearse(BEYOND)
    bound = 0.03
    short = replace(example.parameters, max_ls_reverse_distance=bound)
    failed = rehearse(short, example.layout, position=BEYOND.start)
    procedure = PROCEDURES[HomeType.HSHS]
    return LIMITS.format(
        notice=NOTICE,
        rows='\n'.join(rows),
        bound=1e3 * bound,
        diagram=mermaid(procedure, (State.HSSearch, State.HSFallingEdgeSearchReverse)),
        position=save(figure(course, example.layout, panels=POSITION_DIAGRAM), 'limit_position'),
        profile=save(figure(course, example.layout, panels=PROFILE), 'limit_profile'),
        failure=save(figure(failed, example.layout), 'limit_failure'),
    )


def needs(procedure: Procedure) -> str:
    """Return the inputs that a home type homes on."""
    names = [each.text.replace('z pulse', 'Z-pulse') for each in sorted(procedure.inputs)]
    if procedure.target:
        names.append(f'{procedure.target} limit switch ahead')
    return ', '.join(names) or 'nothing'


def ahead(procedure: Procedure) -> str:
    """Return what the limit switches ahead mean to a home type."""
    roles = procedure.limits_ahead
    if len(set(roles.values())) == 1:
        return str(roles[LimitPair.HARDWARE])
    return ', '.join(f'{pair}: {role}' for pair, role in roles.items())


def save(drawn: Figure, name: str) -> str:
    """Write a figure; return its file's name."""
    file = f'{name}.svg'.replace(' ', '_').replace(',', '')
    (FIGURES / file).write_text(small_svg(drawn))
    return file


def small_svg(drawn: Figure) -> str:
    """Return a figure as SVG that any machine draws alike: lengths to a tenth of a point."""
    buffer = StringIO()
    with rc_context({'svg.fonttype': 'none', 'svg.hashsalt': 'homing_node'}):
        drawn.savefig(buffer, format='svg', metadata={'Date': None, 'Creator': None})
    needless = r'<!--.*?-->|<[?!][^>]*>|<metadata>.*?</metadata>'
    text = re.sub(needless, '', buffer.getvalue(), flags=re.DOTALL).lstrip()
    text = re.sub(r'<[^>]*>', lambda tag: LENGTH.sub(_rounded, tag[0]), text)
    return re.sub(r'\s*\n\s*', '\n', text)


def _rounded(found: re.Match[str]) -> str:
    return f'{float(found[0]):.1f}'.removesuffix('.0')


if __name__ == '__main__':
    main()
