"""What all tests share: hypothesis profiles, and how workers share the tests."""

import os

import pytest
from hypothesis import HealthCheck, Phase, settings

QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile(
    'quick', deadline=None, derandomize=True, max_examples=150, suppress_health_check=QUIET,
    phases=(Phase.explicit, Phase.generate, Phase.shrink))
settings.register_profile('fuzz', deadline=None, max_examples=1500, suppress_health_check=QUIET)
settings.load_profile('fuzz' if os.environ.get('HOMING_FUZZ') else 'quick')

#: Files that start processes or look at a clock.
TIMED = ('test_arrivals', 'test_bench', 'test_cli', 'test_client', 'test_docs', 'test_node_',
         'test_reports', 'test_timebase')
#: Its last test looks back at all the others.
WHOLE = 'test_homing.py'


def pytest_collection_modifyitems(items):
    """Put the timed tests last."""
    items.sort(key=lambda item: item.path.name.startswith(TIMED))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Let workers share the tests; the timed ones all go to one, and nothing runs beside them."""
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.partition('::')[0].rpartition('/')[2]
            return 'timed' if file.startswith(TIMED) else file if file == WHOLE else nodeid

    return Scheduling(config, log)
