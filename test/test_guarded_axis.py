# SPDX-License-Identifier: Apache-2.0
"""An exception in one axis ends the run of that axis and nothing else."""

import pytest
from core_rig import rig

from homing_node.core.machine import Machine
from homing_node.core.profile import Profile
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.gantry import follower_parameters
from homing_node.procedures.states import Error
from homing_node.ros.guarded_axis import GuardedAxis, GuardedGantry

PERIOD = 0.004


class Guarded:
    """An axis that follows its setpoints."""

    def __init__(self):
        self.reports = []
        self.axis = GuardedAxis('x', rig('HS').parameters(), PERIOD, self._report)
        self.now, self.place, self.setpoints = 0.0, 0.05, []
        for switch in self.axis.parameters.inputs:
            self.axis.switch(switch, 0.0, False)
        self.axis.feedback(0.0, self.place)

    def _report(self, text, error):
        self.reports.append((text, error))

    def cycle(self):
        self.now += PERIOD
        self.axis.feedback(self.now, self.place)
        setpoint = self.axis.update(self.now)
        if setpoint is not None:
            self.place = setpoint[0]
            self.setpoints.append(setpoint)


@pytest.fixture
def guarded():
    return Guarded()


@pytest.fixture
def moving(guarded):
    assert guarded.axis.home(0.0) is None
    for _ in range(100):
        guarded.cycle()
    return guarded


def raising(*_):
    raise ArithmeticError('no trajectory')


def test_the_axis_stops_and_says_why(monkeypatch, moving):
    with monkeypatch.context() as patch:
        patch.setattr(Machine, 'update', raising)
        moving.cycle()
    assert moving.axis.error is Error.InternalError
    while moving.axis.running:
        moving.cycle()
    assert moving.setpoints[-1][1] == 0.0  # it has stopped, not frozen
    assert moving.axis.outcome.error is Error.InternalError
    assert moving.axis.outcome.message.startswith("axis x: ArithmeticError('no trajectory')")
    assert not moving.axis.homed
    ((text, error),) = moving.reports
    assert text == "axis x broke: ArithmeticError('no trajectory')"
    assert isinstance(error, ArithmeticError)


@pytest.mark.parametrize(
    ('kind', 'method'), [(Profile, 'update'), (Machine, 'update'), (Profile, 'stop')]
)
def test_a_stop_that_breaks_too_ends_the_run_at_once(monkeypatch, moving, kind, method):
    monkeypatch.setattr(kind, method, raising)
    if method == 'stop':
        monkeypatch.setattr(Machine, 'update', raising)
    moving.cycle()
    moving.cycle()
    assert not moving.axis.running
    assert moving.axis.outcome.error is Error.InternalError
    assert len(moving.reports) == 1
    count = len(moving.setpoints)
    moving.cycle()
    assert len(moving.setpoints) == count


def test_a_run_that_cannot_start_is_refused(monkeypatch, guarded):
    with monkeypatch.context() as patch:
        patch.setattr(Machine, 'begin', raising)
        refusal = guarded.axis.home(0.0)
    assert refusal.error is Error.InternalError
    assert not guarded.axis.running
    assert guarded.axis.outcome is refusal
    assert guarded.axis.home(0.0) is None  # it is not broken for ever


@pytest.mark.parametrize('running', [False, True])
def test_a_message_that_breaks_the_axis(monkeypatch, guarded, running):
    if running:
        assert guarded.axis.home(0.0) is None
    guarded.axis.homed = not running
    monkeypatch.setattr('homing_node.core.readings.Readings.feedback', raising)
    for _ in range(3):
        guarded.cycle()
    assert not guarded.axis.homed
    assert guarded.axis.error is (Error.InternalError if running else Error.NoError)
    assert guarded.axis.history.runs == running
    assert len(guarded.reports) == 1 + running  # once for a run, once at rest


def test_each_run_that_breaks_is_reported(monkeypatch, guarded):
    for number in range(2):
        assert guarded.axis.home(guarded.now) is None
        with monkeypatch.context() as patch:
            patch.setattr(Machine, 'update', raising)
            guarded.cycle()
            guarded.cycle()
        assert not guarded.axis.running
        assert len(guarded.reports) == number + 1


@pytest.mark.parametrize('where', ['the leader', 'the follower'])
def test_a_gantry_is_one_axis(monkeypatch, where):
    """What breaks in a follower stops all sides, and the run ends once."""
    reports = []
    p = axis_parameters({**rig('HS').values, 'max_skew': 0.002, 'followers': ['y2']})
    followers = {'y.y2': follower_parameters(p, 'y2', {})}
    gantry = GuardedGantry('y', p, PERIOD, lambda *told: reports.append(told), 0.0, followers)
    follower = gantry.followers[0]
    place, now = 0.05, 0.0
    for drive in (gantry, follower):
        for switch in drive.parameters.inputs:
            drive.switch(switch, 0.0, False)

    def cycle():
        nonlocal place, now
        now += PERIOD
        for drive in (gantry, follower):
            drive.feedback(now, place)
        setpoint = gantry.update(now)
        if setpoint is not None:
            assert follower.setpoint == setpoint
            place = setpoint[0]

    for _ in range(60):
        cycle()
    assert gantry.home(now) is None
    for _ in range(20):
        cycle()
    with monkeypatch.context() as patch:
        if where == 'the leader':
            patch.setattr(Machine, 'update', raising)
            cycle()
        else:
            patch.setattr(follower.readings, 'feedback', raising)
            follower.feedback(now + 0.001, place)
    assert gantry.error is Error.InternalError
    while gantry.running:
        cycle()
    assert gantry.outcome.error is Error.InternalError
    assert len(reports) == 1
