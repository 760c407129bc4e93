# SPDX-License-Identifier: Apache-2.0
"""`homing convert`: reads another controller's configuration."""

import argparse
from pathlib import Path

from .common import OK, Failure, positive, written

TEXT = """\
Reads the homing of another controller and writes it as a parameter file of homing_node.
Known are LinuxCNC's ini, the $$ dump of grbl and grblHAL, Klipper's printer.cfg, and
ros2_canopen's bus.yml. What has no equal here stands as a comment.
"""

EXAMPLES = """\
examples:
  homing convert machine.ini -o axes.yaml         then: homing check axes.yaml
  homing convert bus.yml --travel 0.5             where the file has no travel

"""

FAILURE = 'no axis of the file can be converted'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('file', metavar='FILE', type=Path, help="the other controller's file")
    parser.add_argument(
        '--travel',
        metavar='M',
        type=positive,
        help='mechanical travel of axes for which the file has none, m or rad',
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='YAML',
        type=Path,
        help='the parameter file to write (default: the terminal)',
    )


def run(arguments: argparse.Namespace) -> int:
    from ..convert import Unconvertible, convert, yaml_text

    source, path = arguments.file, arguments.output
    try:
        text = source.read_text(encoding='utf-8')
    except OSError as error:
        raise Failure(f'{source}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise Failure(f'{source}: not a text file (UTF-8)') from None
    try:
        converted = convert(text, arguments.travel)
        made = yaml_text(converted, source.name)
    except Unconvertible as error:
        raise Failure(f'{source}: {error}', status=1) from None
    if path is None:
        print(made, end='')
    else:
        written(path, lambda: path.write_text(made, encoding='utf-8') and None)
        print(f'wrote {path}')
        for axis in converted.axes:
            if axis.refusal:
                print(f'axis {axis.name} is not converted: {axis.refusal}')
    return OK
