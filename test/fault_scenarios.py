# SPDX-License-Identifier: Apache-2.0
"""The scenarios that go wrong: what is done to the machine, and how the run must end.

Everything is written for an axis that homes toward +1 and run both ways: ``d`` is the direction.
`scripts/faults.py` makes the table of doc/faults.md of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan
from typing import NamedTuple

from core_rig import (
    END,
    HS,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    PROBE,
    TRUE_HOME,
    Rig,
    on_side,
    rig,
)

from homing_node.core.request import Request
from homing_node.plant.layout import SwitchLayout, mirrored
from homing_node.procedures.states import Error, HomeType, Input
from homing_node.rehearsal import disturbances as f
from homing_node.rehearsal.disturbances import DisturbedRehearsal, past

#: What a stop from the fast velocity takes at most, m: v^2 / 2a + v a / 2j + a cycle of travel,
#: and the same again while it still accelerates (v a / j).
STOP = 0.006

Run = Callable[[int], DisturbedRehearsal]


@dataclass(frozen=True)
class Case:
    """One scenario: its number in the survey, how it is made, and how the run must end.

    ``says`` is part of the message, ``home`` the true home position in the toward frame, ``stop``
    the bound of the stopping distance in m; ``hits``: the axis runs against its hard stop;
    ``checked``: the finding by which `homing check` tells it before.
    """

    number: str
    name: str
    made: str
    run: Run
    error: Error = Error.NoError
    says: str = ''
    home: float | None = None
    stop: float = STOP
    hits: bool = False
    checked: str = ''

    @property
    def id(self) -> str:
        return f'{self.number} {self.name}'

    @staticmethod
    def stops(made: DisturbedRehearsal) -> float:
        """Return the stopping distance of a run, m."""
        return 0.0 if made.decided is None else abs(made.plant.position - made.decided)


CASES: list[Case] = []


def case(number: str, name: str, made: str, error: Error | None = None, **rest):
    """Return a decorator that makes a case of a function of the direction."""

    def add(run: Run) -> Run:
        CASES.append(Case(number, name, made, run, error or Error.NoError, **rest))
        return run

    return add


def faulty(one: Rig, d: int, *faults: f.Disturbance, start: float = 0.03) -> DisturbedRehearsal:
    """Return a rehearsal of a rig whose messages pass through faults."""
    layout = one.built(start=start).layout
    layout = layout if d > 0 else mirrored(layout)
    made = DisturbedRehearsal(one.parameters(d), layout, faults, one.transport)
    made.layout = layout
    return made


def homed(one: Rig, d: int, *faults: f.Disturbance, start: float = 0.03) -> DisturbedRehearsal:
    """Return the same after a run."""
    made = faulty(one, d, *faults, start=start)
    made.home(limit=60.0)
    return made


def underway(
    one: Rig, d: int, *faults: f.Disturbance, enabled: bool = False
) -> DisturbedRehearsal:
    """Return the same in its first search; ``enabled``: the drive tells its servo."""
    made = faulty(one, d, *faults)
    if enabled:
        made.axis.enable(True)
    made.cycle()
    assert made.axis.home(made.time) is None
    for _ in range(20):
        made.cycle()
    return made


def finished(made: DisturbedRehearsal) -> DisturbedRehearsal:
    made.finish(limit=60.0)
    return made


HSHS = rig('HSHS', home_shift_distance=0.0)
HERE = TRUE_HOME[HomeType.HSHS]


# ------------------------------------------------------------------------------------- switches


@case('1', 'bounce at the edge', 'each edge of the home switch bounces 3 times in 3 ms', home=HERE)
def _(d):
    return homed(HSHS, d, f.bounces(HS))


@case('1', 'bounce, debounced', 'the same, switch_debounce 10 ms', home=HERE)
def _(d):
    return homed(HSHS.but(switch_debounce=0.01), d, f.bounces(HS))


@case('2', 'bounce while leaving', 'the same, from on the switch', home=HERE)
def _(d):
    return homed(HSHS, d, f.bounces(HS), start=0.063)


@case(
    '2',
    'bounce at the far end of an overrun flag',
    'HSReverseZPulse; the axis overruns a flag of 1.2 mm',
    home=0.0533,
)
def _(d):
    one = rig('HSReverseZPulse').switched(**{HS: SwitchLayout(0.06, 0.0612)})
    return homed(one, d, f.bounces(HS, every=0.0002))


@case('3', 'noise shorter than the debounce', '5 pulses of 2 ms, switch_debounce 5 ms', home=HERE)
def _(d):
    noise = f.noise(HS, past(0.045 * d, d), 0.002, times=5, every=0.006)
    return homed(HSHS.but(switch_debounce=0.005), d, noise)


@case(
    '3',
    'noise taken for the switch',
    'one pulse of 0.1 s, 15 mm before the switch',
    Error.EdgeNotRepeated,
    says='edge_tolerance',
)
def _(d):
    return homed(HSHS, d, f.noise(HS, past(0.045 * d, d), 0.1))


@case(
    '3',
    'noise that is gone when the axis turns',
    'one pulse of 2 ms, no debounce',
    Error.LSTriggered,
    says='limit switch (behind)',
)
def _(d):
    return homed(HSHS, d, f.noise(HS, past(0.045 * d, d), 0.002))


@case(
    '4',
    'switch stuck on at the start',
    'the home switch is on everywhere',
    Error.MaxHSOnAtStartRevDistanceTraveled,
    says='stuck on',
)
def _(d):
    return homed(HSHS.but(max_hs_on_at_start_reverse_distance=0.02), d, f.stuck(HS, True))


@case(
    '4',
    'switch stuck on, no bound of its own',
    'the same, the limit behind comes first',
    Error.LSTriggered,
    says='limit switch (behind)',
)
def _(d):
    return homed(HSHS, d, f.stuck(HS, True))


@case(
    '5',
    'switch stuck off, or its cable cut',
    'the home switch never rises',
    Error.MaxLSRevDistanceTraveled,
    says='did not fall within 0.05 m',
)
def _(d):
    return homed(HSHS.but(max_ls_reverse_distance=0.05), d, f.stuck(HS, False))


@case(
    '5',
    'all switches stuck off',
    'no input ever changes',
    Error.SearchDistanceExceeded,
    says='is the switch wired',
)
def _(d):
    names = (HS, LIMIT_AHEAD, LIMIT_BEHIND)
    return homed(HSHS.but(max_search_distance=0.08), d, *(f.stuck(n, False) for n in names))


@case(
    '6',
    'switch sticks after the first hit',
    'the home switch never falls again',
    Error.LSTriggered,
    says='limit switch (behind)',
)
def _(d):
    return homed(HSHS, d, f.sticks(HS, True))


@case('7', 'start on the home switch', 'in the middle of its flag', home=HERE)
def _(d):
    return homed(HSHS, d, start=0.063)


@case('7', 'start deep in the home switch', 'a flag of 20 mm, 19 mm in', home=HERE)
def _(d):
    return homed(HSHS.switched(home_switch=SwitchLayout(0.06, 0.08)), d, start=0.079)


@case('8', 'start on the target limit', 'LS, 5 mm in', home=TRUE_HOME[HomeType.LS])
def _(d):
    return homed(rig('LS'), d, start=0.095)


@case('9', 'start on the opposite limit', 'on the limit behind', home=HERE)
def _(d):
    return homed(HSHS, d, start=0.001)


@case('10', 'start between the switch and the limit', 'the limit reverses once', home=HERE)
def _(d):
    return homed(HSHS, d, start=0.08)


@case(
    '10',
    'a switch that is lost after the reversal',
    'the home switch sticks off once it fell',
    Error.LSTriggered,
    says='for the second time',
)
def _(d):
    return homed(HSHS, d, f.sticks(HS, False), start=0.08)


BEYOND = HSHS.switched(**{LIMIT_AHEAD: SwitchLayout(0.09, 0.092)})


@case(
    '11',
    'start beyond a momentary limit ahead',
    'no level tells; the hard stop holds it',
    Error.FollowingError,
    says='does the axis follow',
    hits=True,
)
def _(d):
    return homed(BEYOND.built(hard_stops=(-0.05, 0.12)), d, start=0.1)


@case(
    '11',
    'start beyond a momentary limit behind',
    'it rises on the way toward',
    Error.LSTriggered,
    says='swapped',
)
def _(d):
    return homed(HSHS.switched(**{LIMIT_BEHIND: SwitchLayout(0.0, 0.002)}), d, start=-0.02)


@case('12', 'a momentary limit falls during the overrun', 'the limit is 0.3 mm wide', home=HERE)
def _(d):
    one = HSHS.switched(**{LIMIT_AHEAD: SwitchLayout(0.09, 0.0903)})
    return homed(one, d, start=0.07)


@case('13', 'both limits on at the start', 'both levels true', Error.LimitsBothOn, says='polarity')
def _(d):
    return homed(HSHS, d, f.stuck(LIMIT_AHEAD, True), f.stuck(LIMIT_BEHIND, True))


@case(
    '13', 'both limits on during the run', 'both rise at once', Error.LimitsBothOn, says='together'
)
def _(d):
    moment = past(0.045 * d, d)
    names = (on_side(LIMIT_BEHIND, d), on_side(LIMIT_AHEAD, d))
    return homed(HSHS, d, *(f.noise(name, moment, 1.0) for name in names))


@case(
    '14',
    'the opposite limit trips',
    'the limit behind rises while moving toward',
    Error.LSTriggered,
    says='behind',
)
def _(d):
    return homed(HSHS, d, f.noise(on_side(LIMIT_BEHIND, d), past(0.045 * d, d), 1.0))


@case('15', 'limits swapped', "each limit has the other's wire", Error.LSTriggered, says='swapped')
def _(d):
    return homed(HSHS, d, f.swapped(LIMIT_AHEAD, LIMIT_BEHIND), start=0.07)


@case(
    '16',
    'the drive turns the other way',
    'its setpoints are inverted',
    Error.WrongDirection,
    says='wrong_direction_distance',
)
def _(d):
    return homed(HSHS, d, f.scaled(f.SETPOINT, -1.0))


@case(
    '16',
    'the whole axis turns the other way',
    'setpoints and feedback are inverted',
    Error.LSTriggered,
    says='home_direction',
)
def _(d):
    return homed(HSHS, d, f.scaled(f.SETPOINT, -1.0), f.scaled(f.FEEDBACK, -1.0))


@case(
    '17',
    'encoder inverted',
    'the feedback counts the other way',
    Error.WrongDirection,
    says='is the encoder inverted',
)
def _(d):
    return homed(HSHS, d, f.scaled(f.FEEDBACK, -1.0))


# ------------------------------------------------------------------------------------- feedback


@case(
    '18',
    'feedback frozen',
    'messages come, the position stays',
    Error.FollowingError,
    says='following_error',
    stop=0.021,  # back to where the feedback says that the axis is: following_error is 20 mm here
)
def _(d):
    return homed(HSHS, d, f.frozen(past(0.045 * d, d)))


@case(
    '18',
    'feedback lost',
    'no message comes any more',
    Error.FeedbackStale,
    says='feedback_timeout',
)
def _(d):
    one = HSHS.but(feedback_timeout=0.05)
    return homed(one, d, f.lost(f.FEEDBACK, past(0.045 * d, d)))


@case(
    '19',
    'following error',
    'the axis goes half of the way',
    Error.FollowingError,
    says='following_error',
    stop=0.01,
)
def _(d):
    return homed(HSHS, d, f.scaled(f.SETPOINT, 0.5))


@case('19', 'stall', 'the axis stands from 45 mm on', Error.FollowingError, says='following_error')
def _(d):
    return homed(HSHS, d, f.stands(past(0.045 * d, d)))


# ------------------------------------------------------------------------------------- messages


@case(
    '19',
    'the drive is off, and a hand closes the switch',
    'HS; the axis stands, and the home switch rises 2 mm after the start',
    Error.FollowingError,
    says='the feedback did not move',
)
def _(d):
    made = faulty(rig('HS'), d, f.of(f.SETPOINT, lambda one: []))
    made.cycle()
    assert made.axis.home(made.time) is None
    while abs(made.axis.profile.present - 0.03) < 0.002:
        made.cycle()
    made.axis.switch(Input.HOME_SWITCH, made.time, True)
    return finished(made)


@case(
    '20',
    'the edge of the home switch is lost',
    'its rise never arrives: the limit reverses',
    home=HERE,
)
def _(d):
    return homed(HSHS, d, f.lost(HS, count=1))


@case(
    '20',
    'the edge of the limit is lost',
    'the axis comes to its hard stop',
    Error.FollowingError,
    hits=True,
)
def _(d):
    return homed(HSHS, d, f.lost(on_side(LIMIT_AHEAD, d), count=1), start=0.08)


@case(
    '20',
    'a periodic switch falls silent',
    'every 10 ms, then no more; switch_timeout 30 ms',
    Error.SwitchStale,
    says='switch_timeout',
)
def _(d):
    names = (HS, LIMIT_AHEAD, LIMIT_BEHIND)
    moment = past(0.045 * d, d)
    return homed(
        HSHS.but(switch_timeout=0.03),
        d,
        *(f.repeated(name, 0.01, moment if name == HS else None) for name in names),
    )


@case('20', 'setpoints are lost', 'every second one', home=HERE)
def _(d):
    count = iter(range(10**6))
    return homed(HSHS, d, f.of(f.SETPOINT, lambda one: [one] if next(count) % 2 else []))


@case('21', 'switches late by 30 ms', 'their stamps are true', home=HERE)
def _(d):
    moment = past(0.035 * d, d)
    return homed(HSHS, d, *(f.late(n, 0.03, moment) for n in (HS, LIMIT_AHEAD, LIMIT_BEHIND)))


@case(
    '21', 'one edge late by 0.3 s', 'longer than feedback_timeout', Error.SwitchStale, says='late'
)
def _(d):
    one = rig('HS', homing_velocity_fast=0.05)
    return homed(one, d, f.late(HS, 0.01), f.late(HS, 0.3, past(0.055 * d, d)))


@case(
    '21',
    'feedback ever later',
    'by 1 s in 5 s; longer than feedback_timeout in the end',
    Error.FeedbackStale,
    says='late',
)
def _(d):
    def later(one):
        return [one._replace(delay=0.2 * one.sent)]

    one = rig('HS', homing_velocity_fast=0.02, homing_velocity_slow=0.01, following_error=0.5)
    return homed(one, d, f.of(f.FEEDBACK, later))


@case('21', 'messages late and reordered', 'everything up to 8 ms, at random', home=HERE)
def _(d):
    names = (HS, LIMIT_AHEAD, LIMIT_BEHIND, f.FEEDBACK)
    return homed(HSHS, d, *(f.jitters(name, 0.008, i) for i, name in enumerate(names)))


@case('21', 'messages doubled', 'every message again, 5 ms later', home=HERE)
def _(d):
    names = (HS, LIMIT_AHEAD, LIMIT_BEHIND, f.FEEDBACK)
    return homed(HSHS, d, *(f.duplicated(name, 0.005) for name in names))


@case('22', 'switch clock an hour ahead', 'stamps in the future', home=HERE)
def _(d):
    return homed(HSHS, d, f.clock_jumps(HS, 3600.0))


@case('22', 'switch clock an hour behind', 'stamps of the past', home=HERE)
def _(d):
    return homed(HSHS, d, f.clock_jumps(HS, -3600.0))


@case('22', 'feedback clock jumps back', 'by 1 s, 5 mm before the switch', home=HERE)
def _(d):
    return homed(HSHS, d, f.clock_jumps(f.FEEDBACK, -1.0, past(0.055 * d, d)))


@case('22', 'feedback clock jumps ahead', 'by 1 s, 5 mm before the switch', home=HERE)
def _(d):
    return homed(HSHS, d, f.clock_jumps(f.FEEDBACK, 1.0, past(0.055 * d, d)))


@case('18', 'feedback that is no number', 'every second sample is NaN or infinite', home=HERE)
def _(d):
    values = iter([nan, None, inf, None, -inf, None] * 10**5)

    def nonsense(one):
        value = next(values)
        return [one if value is None or one.sent == 0.0 else one._replace(value=value)]

    return homed(HSHS, d, f.of(f.FEEDBACK, nonsense))


@case(
    '23',
    'a switch that was never heard',
    'no message at the start',
    Error.SwitchUnknown,
    says='home_switch',
)
def _(d):
    return homed(HSHS, d, f.of(HS, lambda one: []))


@case(
    '23',
    'feedback that was never heard',
    'no message at the start',
    Error.FeedbackStale,
    says='no feedback yet',
)
def _(d):
    return homed(HSHS, d, f.of(f.FEEDBACK, lambda one: []))


# ------------------------------------------------------------------------------------- requests


@case('25', 'emergency stop', 'in the first search', Error.EmergencyStop)
def _(d):
    made = underway(HSHS, d)
    made.axis.set_emergency_stop(True)
    finished(made)
    made.axis.set_emergency_stop(False)
    return made


@case('26', 'servo off', 'the drive reports it in the first search', Error.ServoOff, stop=0.001)
def _(d):
    one = HSHS.but(switches=[*HSHS.values['switches'], 'servo_enabled'])
    made = underway(one, d, enabled=True)
    made.axis.enable(False)
    made.plant.servo(False)
    return finished(made)


@case('27', 'cancel', 'in the first search, and again while it stops', Error.Canceled)
def _(d):
    made = underway(HSHS, d)
    made.axis.cancel()
    made.cycle()
    made.axis.cancel()
    return finished(made)


@case(
    '28',
    'cancel as the run succeeds',
    'in each of the last 100 cycles: never both',
    Error.Canceled,
)
def _(d):
    cycles = len(homed(HSHS, d).course.samples)
    before = faulty(HSHS, d)
    for last in range(cycles - 100, cycles + 3):
        made = faulty(HSHS, d)
        assert made.axis.home(made.time) is None
        for _ in range(last):
            made.cycle()
        made.axis.cancel()
        finished(made)
        assert made.axis.homed == (made.course.outcome.error is Error.NoError)
        if made.axis.homed:
            return before
        before = made
    raise AssertionError('no run was over before it was canceled')


# ---------------------------------------------------------------------------------------- index


@case(
    '29',
    'a pulse 0.1 mm before the edge',
    'HSZPulse; the next pulse is taken',
    home=0.0699,
    checked='index-margin',
)
def _(d):
    return homed(rig('HSZPulse').built(index_offset=0.0099), d)


@case(
    '29',
    'a pulse 0.1 mm behind the edge',
    'HSZPulse; that pulse is taken',
    home=0.0601,
    checked='index-margin',
)
def _(d):
    return homed(rig('HSZPulse').built(index_offset=0.0001), d)


@case(
    '29',
    'the same, index_margin_action Fail',
    'half a pitch would be best',
    Error.IndexMarginError,
    says='move the switch',
)
def _(d):
    one = rig('HSZPulse', index_margin_action='Fail').built(index_offset=0.0001)
    return homed(one.but(z_pulse_distance_check=0.01), d)


@case('30', 'index missing', 'no pulse comes', Error.ZPulseNotFound, says='max_z_pulse_distance')
def _(d):
    return homed(rig('HSZPulse', max_z_pulse_distance=0.012), d, f.lost('z_pulse'))


@case('30', 'index missing, no bound of its own', 'the limit ahead comes twice', Error.LSTriggered)
def _(d):
    return homed(rig('HSZPulse'), d, f.lost('z_pulse'))


@case(
    '31',
    'index doubled',
    'a second pulse 1 mm further; z_pulse_distance_check',
    Error.ZPulseDistanceCheckError,
    says='z_pulse_distance_check',
)
def _(d):
    one = rig('HSZPulse', multiple_z_pulse=2, z_pulse_distance_check=0.01)
    return homed(one, d, f.doubled('z_pulse', 0.001 * d))


@case(
    '31',
    'latches that are nonsense',
    'NaN, infinite and 10 m ahead, with every pulse',
    home=TRUE_HOME[HomeType.HSZPulse],
)
def _(d):
    def nonsense(one):
        return [one._replace(value=v) for v in (nan, d * inf, 10.0 * d, one.value, -d * inf)]

    return homed(rig('HSZPulse'), d, f.of('z_pulse', nonsense))


# ---------------------------------------------------------------------------------- the machine


@case(
    '32',
    'the switch slips between the passes',
    'by 3 mm; edge_tolerance is 1 mm',
    Error.EdgeNotRepeated,
    says='0.003 m',
)
def _(d):
    made = underway(HSHS, d)
    while made.axis.state != 'SecondHSSearch':
        made.cycle()
    made.plant.move_switch(HS, 0.003 * d)
    return finished(made)


@case(
    '34',
    'the homed axis is pushed',
    'servo off after the run: no longer homed',
    Error.ServoOff,
    says='servo',
)
def _(d):
    made = homed(HSHS, d)
    assert made.axis.homed
    made.axis.set_servo(False)
    assert not made.axis.homed
    made.home()
    return made


@case('37', 'two clients at once', 'the second request of an axis', Error.Busy, says='in progress')
def _(d):
    made = underway(HSHS, d)
    refusal = made.axis.home(made.time)
    finished(made)
    made.course.outcome = refusal
    return made


@case(
    '38',
    'another one moves the axis',
    'a jog takes every setpoint over',
    Error.FollowingError,
    says='does the axis follow',
)
def _(d):
    return homed(HSHS, d, f.of(f.SETPOINT, lambda one: [one._replace(value=0.03 * d)]))


@case(
    '40', 'one axis of a group fails', 'y stops because x does not find its switch', Error.Canceled
)
def _(d):
    rigs = {'x': HSHS.but(max_search_distance=0.02), 'y': HSHS}
    both = {name: faulty(one, d) for name, one in rigs.items()}
    axes = {name: made.axis for name, made in both.items()}
    request = Request([('x', 'y')], axes, 'test', lambda _: None)
    request.start(0.0)
    while not request.done:
        for made in both.values():
            made.cycle()
        request.update(made.time)
    assert request.outcomes['x'].error is Error.SearchDistanceExceeded
    made.course.outcome = request.outcomes['y']
    return made


@case(
    '42',
    'a switch that two axes share',
    'the other axis runs over it in the first pass',
    Error.EdgeNotRepeated,
)
def _(d):
    return homed(HSHS, d, f.noise(HS, past(0.04 * d, d), 0.15))


@case(
    '43',
    'polarity of the home switch wrong',
    'on everywhere but on its flag',
    Error.MaxHSOnAtStartRevDistanceTraveled,
    says='polarity',
)
def _(d):
    one = HSHS.but(max_hs_on_at_start_reverse_distance=0.02)
    return homed(one, d, f.inverted(HS))


@case(
    '43',
    'polarity of the limits wrong',
    'both are on off their flags',
    Error.LimitsBothOn,
    says='polarity',
)
def _(d):
    return homed(HSHS, d, f.inverted(LIMIT_AHEAD), f.inverted(LIMIT_BEHIND))


@case(
    '44',
    'edge too early in the second pass',
    'noise 3 mm before the edge',
    Error.EdgeNotRepeated,
    says='edge_tolerance',
)
def _(d):
    made = underway(HSHS.but(homing_reverse_distance=0.01), d)
    while made.axis.state != 'SecondHSSearch':
        made.cycle()
    while d * made.plant.position < 0.057 or made.axis.profile.velocity < 0.0:
        made.cycle()
    made.axis.switch(Input(HS), made.time, True)
    return finished(made)


@case('45', 'a stall that is not the end', 'the axis sticks for 10 ms on its way', home=END)
def _(d):
    one = rig('MechanicalEndDetection', mechanical_end_detection_time=0.2)
    return homed(one, d, f.stands(past(0.05 * d, d), 0.1), start=0.03)


@case(
    '45',
    'a drive that begins late is not at its end',
    'the axis follows 0.26 s after the first feedback',
    Error.FollowingError,
    says='behind the mechanical end',
)
def _(d):
    one = rig('MechanicalEndDetection', mechanical_end_detection_time=0.1)
    return homed(one, d, f.stands(past(0.03 * d, d), 0.26), start=0.03)


@case(
    '46',
    'a motor without encoder stalls',
    'the drive reports its command',
    Error.SearchDistanceExceeded,
)
def _(d):
    one = HSHS.but(max_search_distance=0.08)
    return homed(one, d, f.no_encoder(), f.stands(past(0.045 * d, d)))


@case(
    '46', 'a motor without encoder loses steps', '3 mm between the passes', Error.EdgeNotRepeated
)
def _(d):
    made = faulty(HSHS, d)
    gate = f.Moment(lambda *_: made.axis.state == 'SecondHSSearch')
    made._disturbances = (f.no_encoder(), f.loses_steps(gate, -0.003 * d))
    made.home(limit=60.0)
    return made


@case(
    '47',
    'ten retries against a stuck switch',
    'none goes further than the first',
    Error.MaxLSRevDistanceTraveled,
    says='is the home switch between the limits',
)
def _(d):
    made = homed(HSHS.but(max_ls_reverse_distance=0.05), d, f.stuck(HS, False))
    low, high = made.low, made.high
    for _ in range(10):
        assert made.home(limit=60.0).outcome.error is Error.MaxLSRevDistanceTraveled
    assert low - 1e-3 < made.low
    assert made.high < high + 1e-3
    return made


@case(
    '48',
    'hard stop at speed',
    'it is 2 mm behind the edge of the limit',
    Error.FollowingError,
    hits=True,
    checked='hard-stop',
)
def _(d):
    one = HSHS.but(following_error=0.002).built(hard_stops=(-0.05, 0.092))
    return homed(one, d, start=0.07)


@case('49', 'cycles held up', '100 ms in the search: the motion is delayed', home=HERE)
def _(d):
    made = underway(HSHS, d)
    made.hold_up(0.1)
    return finished(made)


@case('49', 'cycles held up for too long', '0.5 s in the search', Error.CycleLate)
def _(d):
    made = underway(HSHS, d)
    made.hold_up(0.5)
    return finished(made)


ROTARY = rig('ZPulse', max_search_distance=0.02, max_z_pulse_distance=0.0125)


@case('50', 'index only, no switch', 'ZPulse within 1.25 pitches', home=0.0333)
def _(d):
    return homed(ROTARY, d)


@case('50', 'index only, missing', 'no pulse comes', Error.ZPulseNotFound)
def _(d):
    return homed(ROTARY, d, f.lost('z_pulse'))


@case('51', 'touch probe deflected at the start', 'it triggered before the motion', home=PROBE)
def _(d):
    made = faulty(rig('TouchProbe'), d)
    made.axis.latch(Input.TOUCH_PROBE, made.plant.position)
    made.home(limit=60.0)
    return made


@case('51', 'touch probe of wrong polarity', 'it never triggers', Error.LSTriggered)
def _(d):
    return homed(rig('TouchProbe'), d, f.lost('touch_probe'))


@case(
    '52',
    'the home shift meets a limit',
    'the shift is 40 mm, the limit 30 mm away',
    Error.LSTriggered,
    checked='shift-into-limit',
)
def _(d):
    return homed(HSHS.but(home_shift_distance=0.04), d)


@case('53', 'out of a limit', 'from on the limit ahead: the first motion is away', home=HERE)
def _(d):
    made = homed(HSHS, d, start=0.095)
    assert d * made.course.samples[5].velocity < 0.0
    return made


# --------------------------------------------------------------------------- where the rest is


class Between(NamedTuple):
    """A scenario that needs processes and messages: what happens, and which test shows it."""

    number: str
    name: str
    outcome: str
    test: str


BETWEEN = (
    Between(
        '23',
        'the driver of a switch is restarted',
        '`SwitchStale`; then `SwitchUnknown` until it has told its level',
        'test_node_loss.py::test_a_driver_that_came_back_has_to_tell_the_levels',
    ),
    Between(
        '24',
        'two publishers of one switch',
        '`PublisherConflict`, naming both nodes',
        'test_node_services.py::test_two_publishers_of_a_switch',
    ),
    Between(
        '35',
        'the node dies while an axis homes',
        'the drive stops by itself; a new node knows no home and moves nothing',
        'test_node_faults.py::test_the_node_is_killed',
    ),
    Between(
        '37',
        'two clients at once',
        '`Busy`, naming what runs',
        'test_node_services.py::test_busy_and_meanwhile_everything_else_answers',
    ),
    Between(
        '39',
        'a parameter is set during the run',
        'refused, with the reason',
        'test_node_services.py::test_busy_and_meanwhile_everything_else_answers',
    ),
    Between(
        '-',
        'a switch that is polled',
        'homed; 50 Hz, two passes: known to half of the time between two messages',
        'test_node_drivers.py::test_a_switch_that_is_polled_and_passed_twice',
    ),
    Between(
        '-',
        'a switch that is polled seldom',
        'homed, with a warning; 5 Hz at 50 mm/s: known to about 5 mm',
        'test_node_drivers.py::test_a_switch_that_is_polled_seldom',
    ),
    Between(
        '-',
        'a switch that repeats its level',
        'homed, as exactly as without',
        'test_node_drivers.py::test_a_heartbeat_is_no_polling',
    ),
    Between(
        '-',
        'positions are read less often than published',
        'homed; the uncertainty covers it',
        'test_node_drivers.py::test_a_driver_that_reads_seldom',
    ),
    Between(
        '-',
        'the header stamps have a clock of their own',
        'homed, with a warning; the uncertainty covers both readings',
        'test_node_drivers.py::test_a_header_clock_of_its_own',
    ),
    Between(
        '-',
        'the drive lags by more than a mechanical end is detected by',
        'homed on the end, or `FollowingError`; never on the way',
        'test_node_cases.py::test_case_6_a_drive_that_lags_is_not_at_its_end',
    ),
    Between(
        '-',
        'open_loop_homing, and the command is ahead of the pulse',
        'homed on the first pulse beyond the edge',
        'test_node_cases.py::test_case_16_open_loop_homing_takes_the_first_pulse_beyond_the_edge',
    ),
    Between(
        '-',
        'an axis at a tenth of its speeds',
        'homed; the move by home_shift_distance is no faster than the fast velocity',
        'test_node_cases.py::test_case_22_the_last_move_is_as_fast_as_the_fast_velocity',
    ),
    Between(
        '-',
        'two sources of one joint',
        '`PublisherConflict`, naming the joint, both positions and both nodes',
        'test_node_drivers.py::test_two_sources_of_one_joint',
    ),
    Between(
        '-',
        'a velocity for which the travel is too short is set',
        'refused when it is set',
        'test_node_services.py::test_a_value_that_the_check_calls_an_error_is_refused_when_it_is_set',
    ),
)

#: Why a scenario cannot occur here.
ELSEWHERE = {
    '33': 'Drift by temperature: nothing is taken from earlier runs without a look at the switch. '
    'Every run measures the margin between switch and index and warns before it is used up '
    '(`index_margin`); a home that drifts from run to run is told ([memory.md](memory.md)).',
    '36': 'Power lost while a file is written: it is the old one or the new one, whichever byte '
    'was the last (`test_memory_store.py`). A restarted node takes a home over only where that '
    'is proved ([memory.md](memory.md)).',
    '41': 'A gantry with one of its switches on at the start: an axis here has one '
    'home switch; two coupled motors are two axes, and nothing watches their skew.',
}
