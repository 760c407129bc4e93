# SPDX-License-Identifier: Apache-2.0
"""What all tests share: hypothesis profiles, and how workers share the tests."""

import os
import signal

import pytest
from hypothesis import HealthCheck, Phase, settings

# What a shell starts in the background ignores Ctrl-C, and so would all processes of the tests.
signal.signal(signal.SIGINT, signal.default_int_handler)

QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile(
    'quick',
    deadline=None,
    derandomize=True,
    max_examples=150,
    suppress_health_check=QUIET,
    phases=(Phase.explicit, Phase.generate, Phase.shrink),
)
settings.register_profile('fuzz', deadline=None, max_examples=1500, suppress_health_check=QUIET)
settings.load_profile('fuzz' if os.environ.get('HOMING_FUZZ') else 'quick')

#: Files that start the node, or look at a clock.
TIMED = (
    'test_bench',
    'test_client',
    'test_held_key',
    'test_node_',
    'test_reports',
    'test_timebase',
)
#: The last test of each looks back at all the others of its file.
WHOLE = ('test_homing.py', 'test_rehome.py')


def timed(file):
    return file.startswith(TIMED)


def pytest_collection_modifyitems(items):
    """Put the timed tests first, and then the files that stay whole: they take longest."""
    items.sort(key=lambda item: (not timed(item.path.name), item.path.name not in WHOLE))


def pytest_runtest_setup(item):
    """Let a worker give way at once to the timed tests, and to their processes, of another."""
    if hasattr(item.config, 'workerinput') and not timed(item.path.name):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Let workers share the tests; the timed ones all go to one, the rows of a test stay together.

    A second worker for timed tests saves little on two cores, of which one home takes most of one,
    and some tests then fail.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.partition('::')[0].rpartition('/')[2]
            if timed(file):
                return 'timed'
            return file if file in WHOLE else nodeid.partition('[')[0]

    return Scheduling(config, log)
