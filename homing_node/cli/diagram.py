# SPDX-License-Identifier: Apache-2.0
"""`homing diagram`: draws what a home type does."""

import argparse
from pathlib import Path

from ..procedures.states import HomeType
from ..procedures.tables import PROCEDURES
from .common import OK, Failure, written

TEXT = """\
Draws the state diagram of a home type, from the same table that the node executes.
"""

EXAMPLES = """\
examples:
  homing diagram HSHS                                 Mermaid, for Markdown
  homing diagram HSReverseZPulse -o diagram.svg

"""

FAILURE = 'never'

FORMATS = {'.svg': 'svg', '.mmd': 'mermaid', '.md': 'mermaid'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'type', metavar='TYPE', choices=list(map(str, HomeType)), help=', '.join(HomeType)
    )
    parser.add_argument(
        '--format',
        choices=('mermaid', 'svg'),
        help="default: as FILE's name ends, mermaid on the terminal",
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        type=Path,
        help='.svg, or .mmd or .md for Mermaid (default: the terminal)',
    )


def run(arguments: argparse.Namespace) -> int:
    from ..figures.diagram import mermaid
    from ..figures.diagram_svg import svg

    procedure, path = PROCEDURES[HomeType(arguments.type)], arguments.output
    kind = FORMATS.get(path.suffix) if path else arguments.format or 'mermaid'
    if kind is None or kind != (arguments.format or kind):
        raise Failure(f'{path}: a diagram is written as .svg, or as .mmd or .md (Mermaid)')
    text = svg(procedure) if kind == 'svg' else mermaid(procedure)
    if path is None:
        print(text, end='')
    else:
        written(path, lambda: path.write_text(text, encoding='utf-8') and None)
        print(f'wrote {path}')
    return OK
