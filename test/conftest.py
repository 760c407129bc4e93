"""What the core's tests share: hypothesis profiles, and which arrows of the tables were taken."""

import os

import pytest
from hypothesis import HealthCheck, Phase, settings

from homing_node.machine import Machine

QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile(
    'quick', deadline=None, derandomize=True, max_examples=150, suppress_health_check=QUIET,
    phases=(Phase.explicit, Phase.generate, Phase.shrink))
settings.register_profile('fuzz', deadline=None, max_examples=1500, suppress_health_check=QUIET)
settings.load_profile('fuzz' if os.environ.get('HOMING_FUZZ') else 'quick')

COVERAGE = 'test_every_arrow_was_taken'


@pytest.fixture(scope='session', autouse=True)
def arrows_taken():
    """Collect (home type, step, event) of every arrow that any run of the session takes."""
    taken = set()
    advance = Machine._advance

    def noting(machine, event, cause):
        known = len(machine.arrows)
        advance(machine, event, cause)
        taken.update((machine.procedure.home_type, *arrow) for arrow in machine.arrows[known:])

    Machine._advance = noting
    yield taken
    Machine._advance = advance


def pytest_collection_modifyitems(config, items):
    """Put the arrow coverage last; skip it where only some of the tests run."""
    items.sort(key=lambda item: item.name == COVERAGE)
    part = config.option.keyword or config.option.markexpr or any('.py' in a for a in config.args)
    for item in items:
        if part and item.name == COVERAGE:
            item.add_marker(pytest.mark.skip(reason='needs all tests'))
