# SPDX-License-Identifier: Apache-2.0
"""Runs the benchmarks: python bench [--quick] [--markdown] [name ...]."""

import argparse
import importlib

import figures

NAMES = (
    'core',
    'inputs',
    'simulated',
    'homing_time',
    'setpoints',
    'cycle',
    'record',
    'reaction',
    'start',
    'relay',
    'watch',
)


def main() -> None:
    parser = argparse.ArgumentParser(prog='bench', description='Figures beside bare counterparts.')
    parser.add_argument(
        'names',
        nargs='*',
        metavar='name',
        choices=[*NAMES, 'accuracy', 'cells', []],
        help=f'{", ".join(NAMES)} (these are run by default), accuracy or cells',
    )
    parser.add_argument('--quick', action='store_true', help='only show that it works')
    parser.add_argument('--markdown', action='store_true', help='for doc/performance.md')
    parser.add_argument(
        '--seconds',
        type=float,
        metavar='S',
        help='relay: how long each process is listened to in all, in two parts (default: 50, in '
        'five)',
    )
    arguments = parser.parse_args()
    if arguments.seconds is not None and arguments.names != ['relay']:
        parser.error('--seconds is for relay only')
    print(figures.machine())
    for name in arguments.names or NAMES:
        module = importlib.import_module(name)
        title = module.__doc__.splitlines()[0].rstrip('.')
        how = {} if arguments.seconds is None else {'seconds': arguments.seconds}
        found = list(module.figures(arguments.quick, **how))
        figures.show(title, found, arguments.markdown)


if __name__ == '__main__':
    main()
