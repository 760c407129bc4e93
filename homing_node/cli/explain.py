# SPDX-License-Identifier: Apache-2.0
"""`homing explain`: tells what a home type, or a number of CiA 402, does."""

import argparse
from textwrap import fill

from ..procedures import cia402
from ..procedures.states import Direction, HomeType, LimitPair, Role
from ..procedures.tables import PROCEDURES
from .common import OK, Failure

TEXT = """\
Tells what moves in a home type, where home is, which inputs it needs, and its state diagram.
A number is a homing method of CiA 402; what differs from the standard is told too.
"""

EXAMPLES = """\
examples:
  homing explain 23
  homing explain HSReverse

"""

FAILURE = 'never'

WIDTH = 92


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'type', metavar='TYPE', help='a home type, or a number of CiA 402 (see `homing types`)'
    )
    parser.add_argument(
        '--no-diagram', action='store_true', help='leave out the state diagram (Mermaid)'
    )


def run(arguments: argparse.Namespace) -> int:
    from ..figures.diagram import mermaid
    from ..parameters.definition import suggestion

    text = arguments.type
    try:
        method = cia402.method(text)
    except ValueError as error:
        raise Failure(str(error)) from None
    if method is None and text not in list(HomeType):
        hint = suggestion(text, [str(one) for one in HomeType])
        raise Failure(f'{text!r} is no home type{hint} (`homing types` lists them)')
    home_type = method.home_type if method else HomeType(text)
    procedure = PROCEDURES[home_type]
    print(_title(home_type, method))
    print(f'\nHome: {procedure.home}.\n')
    print(procedure.words)
    print(f'\nNeeds: {_needs(home_type)}.')
    print(f'A limit switch ahead: {_ahead(home_type, method)}.')
    if method:
        print(_standard(method))
    elif numbers := cia402.numbers_of(home_type):
        print(f'\nCiA 402: {", ".join(map(str, numbers))} (`homing explain {numbers[0]}`).')
    if not arguments.no_diagram:
        print(f'\nState diagram (Mermaid):\n\n{mermaid(procedure)}', end='')
    return OK


def _title(home_type: HomeType, method: cia402.Method | None) -> str:
    if method is None:
        return str(home_type)
    if method.direction is None:
        return f'{method} = {home_type}'
    return f'{method} = {home_type} with home_direction {method.direction}'


def _needs(home_type: HomeType) -> str:
    procedure = PROCEDURES[home_type]
    names = [each.text for each in sorted(procedure.inputs)]
    if procedure.target:
        names.append(f'{procedure.target} limit switch ahead')
    return ', '.join(names) or 'no input'


def _ahead(home_type: HomeType, method: cia402.Method | None) -> str:
    roles = PROCEDURES[home_type].limits_ahead
    if method and not method.limit_reversal:
        return 'ends the run (limit_reversal: true lets it turn the axis)'
    if set(roles.values()) == {Role.REVERSAL}:
        return 'turns the axis, once in a run (limit_reversal: false lets it end the run)'
    return ', '.join(f'{pair} {roles[pair]}' for pair in LimitPair)


def _standard(method: cia402.Method) -> str:
    way = '+' if method.direction is Direction.Positive else '-'
    lines = [f'\nToward is the {way} direction.'] if method.direction else ['']
    lines.append(fill(f'The standard: {method.motion}. Home: {method.home}.', WIDTH))
    if method.differences:
        lines.append('Differences:')
    for difference in method.differences:
        lines.append(fill(f'- {difference}', WIDTH, subsequent_indent='  '))
    return '\n'.join(lines)
