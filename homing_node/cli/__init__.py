# SPDX-License-Identifier: Apache-2.0
"""The command `homing`. Only the verbs for the running machine need ROS.

Each verb is a module here with its help texts, its arguments, and `run`, which returns the exit
status.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import metadata

from ..plant import layout_file
from . import (
    cancel,
    check,
    convert,
    diagram,
    doctor,
    explain,
    history,
    home,
    plot,
    propose,
    record,
    repeat,
    resume,
    run,
    survey,
    types,
    verify,
    watch,
)
from .common import INTERRUPTED, OK, USAGE, Failure

STATUS = """\
exit status:
  0  all is well
  1  {failed}
  2  wrong arguments, or a file that cannot be read, used or written
  130  interrupted (Ctrl-C)
"""

MAIN = """\
Checks, rehearses, draws and runs the homing of machine axes.

At the machine, with a homing_node that runs (these need ROS; * moves axes):
  homing doctor                                    look at the running system, reading only
  homing watch                                     a live table of axes and inputs
  homing home x y                                * home axes, and see how far they have come
  homing verify x                                * does the home still hold?
  homing survey x --within 0.2                   * find where everything is: a layout file
  homing cancel                                    stop, and wait until the axes are at rest
  homing continue                                * go on after a pause (pause_mode)
  homing repeat x                                * home ten times: how far do the homes spread?
  homing record x -o run.mcap                      record the next run, reading only

At the desk:
  homing check axes.yaml --layout machine.yaml     prove a configuration before the first motion
  homing run axes.yaml --layout machine.yaml       rehearse it: how long, which way, where to
  homing propose axes.yaml --layout machine.yaml   the values that the check calls right
  homing history x                                 what the memory says: has the switch moved?
  homing plot run.npz                              draw a run
  homing diagram HSHS                              draw what a home type does
  homing types                                     list the home types and their CiA 402 numbers
  homing explain 23                                tell what a home type, or a number, does
  homing convert machine.ini                       read another controller's configuration

`homing COMMAND --help` teaches each of them.
"""

COMMANDS = {
    'doctor': doctor,
    'watch': watch,
    'home': home,
    'verify': verify,
    'cancel': cancel,
    'continue': resume,
    'repeat': repeat,
    'survey': survey,
    'record': record,
    'check': check,
    'run': run,
    'propose': propose,
    'history': history,
    'plot': plot,
    'diagram': diagram,
    'types': types,
    'explain': explain,
    'convert': convert,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    try:
        return _run(argv)
    except KeyboardInterrupt:
        print('homing: interrupted', file=sys.stderr)
        return INTERRUPTED


def _run(argv: Sequence[str] | None) -> int:
    arguments, extra = _parser().parse_known_args(argv)
    if sys.stdout is None:
        print('homing: the output cannot be written: it is closed', file=sys.stderr)
        return USAGE
    try:
        _refuse(extra)
        status: int = COMMANDS[arguments.command].run(arguments)
        sys.stdout.flush()
    except Failure as failure:
        for line in failure.lines:
            print(f'homing: {line}', file=sys.stderr)
        return failure.status
    except BrokenPipeError:  # the reader has seen enough
        _drop_output()
        return OK
    except OSError as error:
        if error.filename is not None:
            raise
        _drop_output()
        print(f'homing: the output cannot be written: {error.strerror}', file=sys.stderr)
        return USAGE
    return status


def _refuse(extra: Sequence[str]) -> None:
    """Raise Failure for arguments that are too many."""
    for each in extra:
        if not each.startswith('-'):
            hint = f': use --layout {each}' if layout_file.is_layout(each) else ''
            raise Failure(f'{each}: one file too many, a command takes one{hint}')
        raise Failure(f'{each}: no such option')


def _drop_output() -> None:
    """Discard the output: Python would try to write it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='homing',
        description=MAIN,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=STATUS.format(failed='a finding is an error, or a run failed'),
    )
    version = f'homing_node {metadata.version("homing_node")}'
    parser.add_argument('--version', action='version', version=version)
    commands = parser.add_subparsers(metavar='COMMAND', dest='command', required=True)
    for name, command in COMMANDS.items():
        verb = commands.add_parser(
            name,
            help=command.TEXT.partition('.')[0].partition(':')[0].partition(',')[0],
            description=command.TEXT,
            epilog=command.EXAMPLES + STATUS.format(failed=command.FAILURE),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        verb.add_argument('--version', action='version', version=version)
        command.add_arguments(verb)
    return parser
