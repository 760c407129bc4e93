# SPDX-License-Identifier: Apache-2.0
"""Runs the scenarios of test/fault_scenarios.py: prints their table, or makes doc/faults.md.

`faults.py` prints, `faults.py --write` writes.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / 'test'))

from fault_scenarios import BETWEEN, CASES, ELSEWHERE, Case  # noqa: E402

PAGE = ROOT / 'doc' / 'faults.md'

HEAD = """\
<!-- Made by `make docs` from test/fault_scenarios.py. -->

# Faults

What goes wrong on real machines, and what the axis does then: it homes right, or it stops and
names the error. After an error it is not homed, and nothing moves until the next request.
[errors.md](errors.md) tells what to do about each error.

`make test-faults` runs every row in both directions and prints this table.

## One axis

The axis is 100 mm long, the home switch at 60 mm, the limits at 2 mm and 90 mm. It homes toward
positive at 200 mm/s and starts at 30 mm where nothing else is said. `ls_dec` is 8 m/s², `max_jerk`
500 m/s³. *Stop* is how far the axis goes from where the node decides to stop. A row with a code is
also found by `homing check` before anything moves.

"""

BETWEEN_HEAD = """
## Between processes

Real processes on a real graph; the tests measure what the rows say.

| # | what goes wrong | what happens | shown by |
|---|---|---|---|
"""

LIMITS = """
## What no node can see

- **Noise that lasts longer than `switch_debounce`** on a type that passes the switch once (`HS`,
  `HSOff`, `LS` …): it is the edge. `HSHS` passes twice and ends with `EdgeNotRepeated`.
- **A jam on the way** with a `MechanicalEndDetection` type that lasts longer than
  `mechanical_end_detection_time`: it is the end.
- **The wrong `home_direction`**, all else being right, on a type that homes on the home switch:
  the limit reverses, and the axis homes on the other side of the flag.
- **A start beyond a momentary limit**: no level tells. Flags that reach up to the hard stop do.
- **A clock that jumps in the moment of an edge** by less than `feedback_timeout`: the edge is
  where the stamp says. `HSHS` ends with `EdgeNotRepeated`.

## What cannot occur here

"""

DRIVE = """
## What the drive must do

The node sends setpoints. When it dies, or the network is cut, a controller that plays \
trajectories stops the
axis by itself; with `setpoint_interface: position` only the drive can:

- **A command timeout.** No setpoint for 50 to 100 ms while moving: the drive stops with a
  deceleration of its own and reports a fault. Then it must ignore setpoints until it is enabled
  again.
- **Limit switches at the drive**, if it has inputs for them. The limits that the node reads arrive
  over the same network.
- **Its own following error window.** The node's works on feedback that may be late.

`simulated_axes` stands for such a drive with `<axis>.command_timeout` (s) and `<axis>.stop_dec`
(m/s²): the drive keeps its velocity for that long, then stops, and heeds no setpoint until
`~/<axis>/servo_on` comes again.
"""


def outcome(case: Case) -> str:
    """Tell how a case ends."""
    error = str(case.error)
    return 'homed' if error == 'NoError' else f'`{error}`'


def rows() -> list[tuple[str, ...]]:
    """Run every case; return number, name, how it is made, outcome, stop in mm, code."""
    found = []
    for case in sorted(CASES, key=lambda case: int(case.number)):
        made = case.run(1)
        end = made.course.outcome
        ended = 'homed' if end.success else f'`{end.error}`'
        stop = '' if made.decided is None else f'{1e3 * case.stops(made):.1f}'
        checked = f'`{case.checked}`' if case.checked else ''
        found.append((case.number, case.name, case.made, ended, stop, checked))
    return found


def page() -> str:
    """Return the whole page."""
    lines = [
        '| # | what goes wrong | made by | outcome | stop, mm | `homing check` |',
        '|---|---|---|---|---|---|',
    ]
    lines += ['| ' + ' | '.join(row) + ' |' for row in rows()]
    between = [
        f'| {row.number} | {row.name} | {row.outcome} | `{row.test.partition("::")[0]}` |'
        for row in BETWEEN
    ]
    elsewhere = [f'- **{number}** {why}' for number, why in ELSEWHERE.items()]
    return (
        HEAD
        + '\n'.join(lines)
        + '\n'
        + BETWEEN_HEAD
        + '\n'.join(between)
        + '\n'
        + LIMITS
        + '\n'.join(elsewhere)
        + '\n'
        + DRIVE
    )


def print_table() -> None:
    """Print the table; a row that is not as specified is marked."""
    expected = {case.id: case for case in CASES}
    good = 0
    for number, name, _, ended, stop, _ in rows():
        case = expected[f'{number} {name}']
        as_specified = ended == outcome(case) and float(stop or 0.0) <= 1e3 * case.stop
        good += as_specified
        stops = f'{stop} mm' if stop else ''
        mark = '' if as_specified else f'  expected: {outcome(case)}'
        print(f'{number:>3} {name:46} {ended.strip("`"):34} {stops:>7}{mark}')
    print(f'{good} of {len(CASES)} as specified')


if __name__ == '__main__':
    if '--write' in sys.argv:
        PAGE.write_text(page())
    else:
        print_table()
