"""`homing diagram`: draws what a home type does."""

import argparse
from pathlib import Path

from ..procedures import PROCEDURES
from ..states import HomeType
from .common import OK, written

TEXT = """\
Draws the state diagram of a home type, from the same table that the node executes.
"""

EXAMPLES = """\
examples:
  homing diagram HSHS                                 Mermaid, for Markdown
  homing diagram HSReverseZPulse -o diagram.svg

"""

FAILURE = 'never'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('type', metavar='TYPE', choices=list(map(str, HomeType)),
                        help=', '.join(HomeType))
    parser.add_argument('--format', choices=('mermaid', 'svg'),
                        help="default: svg where FILE's name ends so, else mermaid")
    parser.add_argument('-o', '--output', metavar='FILE', type=Path, help='default: the terminal')


def run(arguments: argparse.Namespace) -> int:
    from ..diagram import mermaid
    from ..diagram_svg import svg

    procedure, path = PROCEDURES[HomeType(arguments.type)], arguments.output
    kind = arguments.format or ('svg' if path and path.suffix == '.svg' else 'mermaid')
    text = svg(procedure) if kind == 'svg' else mermaid(procedure)
    if path is None:
        print(text, end='')
    else:
        written(path, lambda: path.write_text(text, encoding='utf-8') and None)
        print(f'wrote {path}')
    return OK
