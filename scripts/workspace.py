# SPDX-License-Identifier: Apache-2.0
"""Lay both packages out as siblings: for the `src/` of a workspace, or for a release.

colcon, rosdep and bloom look for packages in a folder and do not look below a package. Here
homing_interfaces lies below homing_node, so they need it beside homing_node:

    python3 scripts/workspace.py ~/ws/src            links; a repository in ~/ws/src stays there
    python3 scripts/workspace.py --copy ~/release    copies without tools and generated files
"""

import argparse
import os
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: The folder of each package.
PACKAGES = {
    'homing_node': ROOT,
    'homing_interfaces': ROOT / 'interfaces' / 'homing_interfaces',
}
#: What a copy leaves out: other packages, environments, and what tools generate.
LEFT_OUT = shutil.ignore_patterns(
    '.git',
    '.venv*',
    '.*_cache',
    '.hypothesis',
    '__pycache__',
    '*.egg-info',
    'build',
    'install',
    'log',
    'interfaces',
)


def lay_out(folder: Path, copy: bool = False) -> list[Path]:
    """Put both packages into a folder, as links or as copies; return their places.

    A package that already is in the folder stays: a repository that was cloned there, or a link of
    an earlier call.

    Raises:
        FileExistsError: Something else has the name of a package there.
    """
    folder = folder.expanduser().resolve()
    folder.mkdir(parents=True, exist_ok=True)
    places = []
    for name, source in PACKAGES.items():
        if source.parent == folder and not copy:
            places.append(source)
            continue
        place = folder / name
        if place.is_symlink() and place.resolve() == source and not copy:
            places.append(place)
            continue
        if place.exists() or place.is_symlink():
            raise FileExistsError(f'{place} exists, and is not a link to {source}')
        if copy:
            shutil.copytree(source, place, ignore=LEFT_OUT)
            if not (place / 'LICENSE').exists():
                shutil.copy(ROOT / 'LICENSE', place)
        else:
            place.symlink_to(os.path.relpath(source, folder), target_is_directory=True)
        places.append(place)
    return places


def main() -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('folder', type=Path, help='for example ~/ws/src')
    parser.add_argument('--copy', action='store_true', help='copy instead of linking')
    arguments = parser.parse_args()
    try:
        for place in lay_out(arguments.folder, arguments.copy):
            print(place)
    except OSError as error:
        print(f'workspace.py: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
