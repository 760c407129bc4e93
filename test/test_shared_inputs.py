# SPDX-License-Identifier: Apache-2.0
"""One signal for two inputs: what the check finds, and which requests are refused."""

import pytest
from core_rig import DIRECTIONS, REVERSING, introduce_again, rig

from homing_node.check import Severity, check, errors
from homing_node.core.axis import Axis
from homing_node.core.shared_signals import SharedSignals
from homing_node.parameters.configuration import configuration
from homing_node.parameters.wiring import Place, wiring_of
from homing_node.plant.layout import mirrored
from homing_node.plant.simulated_axis import SimulatedAxis
from homing_node.procedures.states import Error, Input, LimitPair

HS, POSITIVE, NEGATIVE = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'


def configured(*axes, sequence=None, **values):
    """Return a configuration; each axis is a mapping of its own values."""
    flat = {'axes': ['x', 'w'][: len(axes)]}
    if sequence:
        flat['home_sequence'] = sequence
    for name, own in zip(flat['axes'], axes, strict=True):
        common = {'home_type': 'HSHS', 'travel': 0.2, 'homing_reverse_distance': 0.002}
        for key, value in {**common, 'max_jerk': 100.0, **values, **own}.items():
            flat[f'{name}.{key}'] = value
    return configuration(flat)


def found(checked, *names):
    return {(one.axis, one.check): one for one in check(checked) if one.check in names}


@pytest.mark.parametrize(
    ('home_type', 'fits'), [('HS', 'LS'), ('HSHS', 'LS'), ('HSZPulse', 'LSReverseZPulse')]
)
def test_a_home_switch_that_is_the_limit_ahead_is_an_error_with_the_type_that_fits(
    home_type, fits
):
    wired = [HS, POSITIVE, NEGATIVE] + (['z_pulse'] if 'Z' in home_type else [])
    own = {'topics.home_switch': '/end', f'topics.{POSITIVE}': '/end', 'switches': wired}
    one = found(configured(own, home_type=home_type), 'home-is-limit')['x', 'home-is-limit']
    assert one.severity is Severity.error
    assert f'home_type: {fits}, or switches without {POSITIVE}' in one.text
    assert '/end' in one.text


@pytest.mark.parametrize('direction', ['Positive', 'Negative'])
def test_a_home_switch_copied_from_the_limit_behind_names_the_other_direction(direction):
    behind, other = (NEGATIVE, 'Negative') if direction == 'Positive' else (POSITIVE, 'Positive')
    own = {'topics.home_switch': f'~/x/{behind}', 'home_direction': direction}
    one = found(configured(own), 'home-is-limit')['x', 'home-is-limit']
    assert one.severity is Severity.error
    assert f'home_type: LS with home_direction: {other}' in one.text


def test_a_type_without_the_home_switch_may_share_it():
    own = {'home_type': 'LS', 'topics.home_switch': '/end', f'topics.{POSITIVE}': '/end'}
    assert not found(configured(own), 'home-is-limit')


def test_limits_in_series_are_an_error_only_for_types_that_home_on_one():
    both = {f'topics.{POSITIVE}': '/ends', f'topics.{NEGATIVE}': '/ends'}
    checked = configured(both)
    assert wiring_of(checked).in_series('x') == {LimitPair.HARDWARE}
    assert found(checked, 'limits-in-series')['x', 'limits-in-series'].severity is Severity.info
    assert not errors(check(checked))
    on_limit = found(configured(both, home_type='LS'), 'limits-in-series')
    assert on_limit['x', 'limits-in-series'].severity is Severity.error


def test_axes_that_share_a_switch_must_not_home_together():
    shared = {'topics.home_switch': '/home', 'switches': [HS]}
    together = configured(shared, shared, sequence=['x, w'])
    names = found(together, 'shared-together')
    assert set(names) == {('x', 'shared-together'), ('w', 'shared-together')}
    assert all(one.severity is Severity.error for one in names.values())
    assert not found(configured(shared, shared, sequence=['x', 'w']), 'shared-together')


@pytest.mark.parametrize(
    ('home_type', 'shift', 'leaves'),
    [('HSHS', -0.002, True), ('HSHS', 0.0, False), ('HSOff', 0.002, True), ('HS', 0.002, False)],
)
def test_an_axis_must_leave_a_shared_switch(home_type, shift, leaves):
    shared = {'topics.home_switch': '/home', 'switches': [HS]}
    checked = configured(shared, shared, home_type=home_type, home_shift_distance=shift)
    assert bool(found(checked, 'shared-not-left')) is not leaves


def test_inputs_of_their_own_are_not_shared():
    assert not found(configured({}, {}), 'home-is-limit', 'limits-in-series', 'shared-together')


@pytest.fixture
def shared():
    own = {'topics.home_switch': '/home', 'switches': [HS]}
    checked = configured(own, own)
    axes = {name: Axis(name, parameters, 0.004) for name, parameters in checked.axes.items()}
    for axis in axes.values():
        axis.feedback(0.0, 0.1)
        axis.switch(Input.HOME_SWITCH, 0.0, False)
    return axes, SharedSignals(axes, wiring_of(checked))


def test_an_axis_waits_for_the_one_that_homes_on_its_switch(shared):
    axes, signals = shared
    assert signals.refusal('w') is None
    assert axes['x'].home(0.0) is None
    refusal = signals.refusal('w')
    assert refusal.error is Error.Busy
    assert 'axis x is homing' in refusal.message
    assert '/home' in refusal.message


def test_an_axis_is_refused_while_its_shared_switch_is_on(shared):
    axes, signals = shared
    axes['w'].switch(Input.HOME_SWITCH, 1.0, True)
    refusal = signals.refusal('w')
    assert refusal.error is Error.SwitchUnknown
    assert 'axis x' in refusal.message
    axes['w'].switch(Input.HOME_SWITCH, 2.0, False)
    assert signals.refusal('w') is None


def test_a_place_reads_as_a_parameter():
    assert str(Place('x', Input.HOME_SWITCH)) == 'x.home_switch'


# ------------------------------------------------------------------- both limits on one input


class OneInput(SimulatedAxis):
    """A plant whose two limit switches are wired in series: each input reads either of them."""

    __slots__ = ()

    def _either(self):
        levels = super().levels()
        return levels[POSITIVE] or levels[NEGATIVE]

    def levels(self):
        return {**super().levels(), POSITIVE: self._either(), NEGATIVE: self._either()}

    def step(self, dt):
        before = self._either()
        happenings = []
        for one in super().step(dt):
            if one.input not in (POSITIVE, NEGATIVE):
                happenings.append(one)
            elif one.value != before:  # the two flags never overlap
                before = one.value
                happenings += [one._replace(input=name) for name in (POSITIVE, NEGATIVE)]
        return happenings


def in_series(home_type, start, direction=1, **changes):
    """Return a rehearsal of an axis whose limit switches are one input."""
    rehearsal = rig(home_type, **changes).rehearsal(direction, start)
    layout = rig(home_type).layout._replace(start=start)
    rehearsal.plant = OneInput(layout if direction > 0 else mirrored(layout))
    rehearsal.axis.readings.wire_in_series([LimitPair.HARDWARE])
    introduce_again(rehearsal)
    return rehearsal


def one_by_one(home_type, start, direction=1, **changes):
    return rig(home_type, **changes).home(direction, start)


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('start', [0.02, 0.05, 0.063, 0.07, 0.085])
@pytest.mark.parametrize('home_type', REVERSING)
def test_a_run_is_the_same_with_limits_in_series(home_type, start, direction):
    course = in_series(home_type, start, direction).home(60.0)
    plain = one_by_one(home_type, start, direction)
    assert course.outcome.success
    assert course.samples == plain.samples
    assert course.outcome == plain.outcome


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_no_run_starts_while_limits_in_series_are_on_and_the_end_is_unknown(direction):
    course = in_series('HS', 0.0005, direction).home(60.0)
    assert course.outcome.error is Error.LimitsBothOn
    assert 'by hand' in course.outcome.message
    assert not course.samples


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_an_axis_backs_off_from_the_end_where_limits_in_series_rose(direction):
    """The home switch is dead: the axis meets the limit ahead, then the limit behind."""
    rehearsal = in_series('HS', 0.05, direction)
    rehearsal.plant.move_switch(HS, 1.0 * direction)
    first = rehearsal.home(60.0)
    assert first.outcome.error is Error.LSTriggered
    assert '(behind)' in first.outcome.message
    rehearsal.plant.move_switch(HS, -1.0 * direction)
    assert rehearsal.home(60.0).outcome.success  # it stands on the limit behind, and leaves it


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_an_axis_moved_by_hand_onto_a_limit_in_series_has_no_known_end(direction):
    rehearsal = in_series('HS', 0.05, direction)
    assert rehearsal.home(60.0).outcome.success
    rehearsal.axis.switch(Input.POSITIVE_LIMIT_SWITCH, rehearsal.time + 1.0, True)
    rehearsal.axis.switch(Input.NEGATIVE_LIMIT_SWITCH, rehearsal.time + 1.0, True)
    assert rehearsal.home(60.0).outcome.error is Error.LimitsBothOn
