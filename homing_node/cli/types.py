# SPDX-License-Identifier: Apache-2.0
"""`homing types`: lists every home type with its numbers."""

import argparse

from ..procedures import cia402
from ..procedures.states import Direction
from ..procedures.tables import PROCEDURES
from .common import OK

TEXT = """\
Lists every home type with the homing methods of CiA 402 (object 0x6098) that it stands for.
`home_type` takes the name or the number; a number implies the direction.
"""

EXAMPLES = """\
examples:
  homing types

"""

FAILURE = 'never'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add no argument."""


def run(arguments: argparse.Namespace) -> int:
    width = max(map(len, PROCEDURES))
    print(f'{"home_type":{width}}  {"CiA 402":22}  the home position is')
    for home_type, procedure in PROCEDURES.items():
        methods = [cia402.METHODS[number] for number in cia402.numbers_of(home_type)]
        sides = {Direction.Positive: '+', Direction.Negative: '-', None: ''}
        numbers = ' '.join(f'{one.number}{sides[one.direction]}' for one in methods)
        print(f'{home_type:{width}}  {numbers:22}  {procedure.home}')
    print('\n+ and - behind a number: it homes toward positive or negative.')
    print('`homing explain TYPE` tells what moves, and how a number differs from the standard.')
    return OK
