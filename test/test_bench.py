# SPDX-License-Identifier: Apache-2.0
"""The benchmarks run and give their figures; an axis in a search does not gather memory."""

import subprocess
import sys
import tracemalloc
from pathlib import Path

import pytest

BENCH = Path(__file__).resolve().parent.parent / 'bench'
#: A figure that each benchmark gives.
FIGURES = {
    'core': 'Axis.update',
    'inputs': 'a message of 8 × 16 values',
    'simulated': 'core and plant',
    'homing_time': 'A: HSHS, 1000 Hz, until homed',
    'setpoints': 'controller at 1000 Hz, arrival late by up to 0.3 ms',
    'cycle': 'lateness p99',
    'reaction': 'reaction at 250 Hz',
    'start': '32 axes',
    'relay': 'added latency p99',
    'watch': '32 axes, 200 inputs at 10 Hz',
    'accuracy': 'errors that the uncertainty covers',
}


@pytest.mark.long
@pytest.mark.parametrize('name', FIGURES)
def test_a_benchmark_gives_its_figures(name):
    ran = subprocess.run(
        [sys.executable, BENCH, name, '--quick', '--markdown'],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    rows = [line.split(' | ') for line in ran.stdout.splitlines() if line.startswith('| ')]
    assert rows[0][0] == '| figure'
    assert any(FIGURES[name] in row[0] for row in rows[2:])


def test_a_search_does_not_gather_memory():
    sys.path.insert(0, str(BENCH))
    try:
        from core import feed_and_update, searching
    finally:
        sys.path.remove(str(BENCH))
    axis = searching()
    feed_and_update(axis, 3000, start=600)  # until the record of the feedback is full
    tracemalloc.start()
    try:
        feed_and_update(axis, 100, start=3600)  # and each of its entries is a traced one
        feed_and_update(axis, 2400, start=3700)
        before, _ = tracemalloc.get_traced_memory()
        feed_and_update(axis, 10_000, start=6100)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert axis.running
    assert after - before < 1000
    assert peak - before < 10_000
