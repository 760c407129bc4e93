# SPDX-License-Identifier: Apache-2.0
"""Write what an environment with ROS 2 Kilted needs, made from the files for Jazzy.

`python scripts/kilted.py FOLDER` writes the requirement files into the folder, and
`homing_interfaces/`, a copy of the interfaces that builds against Kilted's wheels. The wheels of
two distributions share their names, so each distribution needs an environment of its own.
"""

import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INTERFACES = ROOT / 'interfaces' / 'homing_interfaces'
#: Files of pins that name Jazzy's packages; the first one includes the second one.
REQUIREMENTS = ('requirements-dev.txt', 'requirements.txt')

#: The version in Kilted of each ROS package that a file for Jazzy names.
VERSIONS = {
    'rclpy': '9.1.2',
    'common-interfaces': '5.5.1',
    'action-msgs': '2.3.0',
    'builtin-interfaces': '2.3.0',
    'ament-cmake': '2.7.3',
    'ament-cmake-gmock': '2.7.3',
    'ament-cmake-gtest': '2.7.3',
    'ament-cmake-include-directories': '2.7.3',
    'ament-cmake-pytest': '2.7.3',
    'ament-cmake-ros': '0.14.5',
    'ament-cmake-ros-core': '0.14.5',
    'ament-package': '0.17.2',
    'rosidl-core-generators': '0.3.1',
    'rosidl-default-generators': '1.7.1',
}
#: Packages that Kilted does not have, and the package that takes over their task.
REPLACED = {'python-cmake-module': 'ament-cmake-ros-core'}

PIN = re.compile(r'ros-jazzy-(?P<name>[a-z0-9-]+)(?P<extra>\[\w+\])?==[\d.]+')


def for_kilted(text: str) -> str:
    """Return the text with each pinned package of Jazzy replaced by Kilted's.

    Raises:
        KeyError: A package has no version in `VERSIONS`.
    """

    def pin(found: re.Match[str]) -> str:
        name = REPLACED.get(found['name'], found['name'])
        return f'ros-kilted-{name}{found["extra"] or ""}=={VERSIONS[name]}'

    return PIN.sub(pin, text)


def write(folder: Path) -> None:
    """Write the requirements and the interfaces for Kilted into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in REQUIREMENTS:
        (folder / name).write_text(for_kilted((ROOT / name).read_text()))
    copy = folder / INTERFACES.name
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(INTERFACES, copy, ignore=shutil.ignore_patterns('build', '*.egg-info'))
    project = copy / 'pyproject.toml'
    project.write_text(for_kilted(project.read_text()))


if __name__ == '__main__':
    if len(sys.argv) != 2:
        sys.exit(f'usage: {sys.argv[0]} FOLDER')
    write(Path(sys.argv[1]))
