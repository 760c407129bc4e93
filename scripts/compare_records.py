# SPDX-License-Identifier: Apache-2.0
"""Compare the records of a few hundred rehearsed runs between two checkouts, bit by bit.

    python scripts/compare_records.py OLD NEW

OLD and NEW are folders with a checkout each. Prints how many records are the same, and names those
that differ. The exit status is 1 if any record differs. Use it before and after a change that must
not change how an axis homes.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

RUNS = """
import hashlib, json
from core_rig import DIRECTIONS, TYPES, rig
STARTS = (0.0015, 0.003, 0.021, 0.05, 0.0605, 0.063, 0.0659, 0.07, 0.081, 0.0875, 0.0895)
VARIANTS = {'plain': {}, 'shift': {'home_shift_distance': -0.001},
            'slow': {'homing_velocity_fast': 0.07, 'homing_reverse_distance': 0.002}}
digests = {}
for home_type in TYPES:
    for name, changes in VARIANTS.items():
        for direction in DIRECTIONS:
            for start in STARTS:
                course = rig(home_type).but(**changes).home(direction, start)
                text = repr(([tuple(s) for s in course.samples],
                             [tuple(h) for h in course.happenings],
                             [(tuple(map(str, step)), str(event))
                              for step, event in course.arrows],
                             tuple(course.outcome)[:5]))
                digests[f'{home_type} {name} {direction:+d} {start}'] = (
                    hashlib.sha256(text.encode()).hexdigest())
print(json.dumps(digests))
"""


def records(tree: Path) -> dict[str, str]:
    """Rehearse the runs with the sources of a checkout; return a digest of each record."""
    paths = os.pathsep.join(map(str, (tree.resolve(), tree.resolve() / 'test')))
    run = subprocess.run(
        [sys.executable, '-c', RUNS],
        cwd=tree,
        env={**os.environ, 'PYTHONPATH': paths},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    found: dict[str, str] = json.loads(run.stdout)
    return found


def main() -> int:
    """Compare two checkouts; return the exit status."""
    if len(sys.argv) != 3:
        print(__doc__)
        return 2
    old, new = (records(Path(tree)) for tree in sys.argv[1:])
    differ = [name for name in old if new.get(name) != old[name]]
    for name in differ:
        print(f'differs: {name}')
    print(f'{len(old) - len(differ)} of {len(old)} records are the same')
    return bool(differ) or old.keys() != new.keys()


if __name__ == '__main__':
    sys.exit(main())
