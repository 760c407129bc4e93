# SPDX-License-Identifier: Apache-2.0
"""What an axis knows after a restart: what was restarted, which encoder, and what has changed."""

import dataclasses
import itertools

import pytest
from core_rig import rig

from homing_node.memory.fingerprint import NO_ORIGIN, configuration_hash
from homing_node.memory.keeper import Keeper
from homing_node.memory.records import Head, Rest
from homing_node.memory.restoring import (
    CHANGED,
    MOVED,
    OTHER,
    Present,
    Refused,
    Restored,
    restored,
)
from homing_node.memory.store import Contents, line_of, read
from homing_node.parameters.axis import AxisParameters, axis_parameters
from homing_node.procedures.states import Error, Input

TURN = 0.005
VALUES = {
    'home_type': 'HSHS',
    'travel': 0.2,
    'restore': 'trust',
    'restore_tolerance': 50e-6,
    'encoder_turn': TURN,
    'brake': True,
}


def parameters(**changes):
    return axis_parameters({**VALUES, **changes})


def rest(**changes):
    """Return the axis as it was: at 0.12, homed at 0.1, when the node ended in order."""
    values = {
        'position': 0.12,
        'homed': True,
        'home': 0.1,
        'offset': 0.05,
        'uncertainty': 2e-6,
        'ended': True,
        'configuration': 'c',
        'publisher': '/driver 01',
        'boot': 'boot 1',
    }
    return Rest(**{**values, **changes})


def present(**changes):
    values = {
        'position': 0.12,
        'configuration': 'c',
        'publisher': '/driver 01',
        'boot': 'boot 1',
    }
    return Present(**{**values, **changes})


NEW = {  # what is new after each restart
    'node': {},
    'driver': {'publisher': '/driver 02'},
    'host': {'publisher': '/driver 02', 'boot': 'boot 2'},
}
MOVES = {'0': 0.0, '10 µm': 10e-6, '1 mm': 0.001, 'one turn': TURN}


def expected(restarted, encoder, moved, changed):
    """Return what must become of the home: None if it is restored, else the text."""
    if changed:
        return CHANGED
    if restarted != 'node' and encoder == 'incremental':
        return OTHER
    if moved == 'one turn' and encoder == 'single_turn' and restarted != 'node':
        return None  # the brake has held it: that is the driver's own count of turns
    return MOVED if moved in ('1 mm', 'one turn') else None


@pytest.mark.parametrize(
    ('restarted', 'encoder', 'moved', 'changed'),
    list(itertools.product(NEW, ('absolute', 'single_turn', 'incremental'), MOVES, (False, True))),
)
def test_a_home_is_restored_exactly_where_the_proof_holds(restarted, encoder, moved, changed):
    now = present(
        position=0.12 + MOVES[moved],
        configuration='d' if changed else 'c',
        **NEW[restarted],
    )
    found = restored(Contents(rest()), now, parameters(encoder=encoder))
    refused = expected(restarted, encoder, moved, changed)
    if refused is None:
        turns = TURN if moved == 'one turn' else 0.0
        assert found == Restored(pytest.approx(0.1 + turns), pytest.approx(0.05 + turns), 2e-6)
    else:
        assert isinstance(found, Refused)
        assert found.text.startswith(f'{refused}: ')


def text_of(contents, now=None, **changes):
    found = restored(contents, now or present(), parameters(**changes))
    assert isinstance(found, Refused)
    return found.text


def test_what_the_refusals_say():
    assert text_of(Contents(rest()), present(position=0.1213)) == (
        'moved while off: the axis was at 0.12 m and is at 0.1213 m, +1.3 mm, more than 50 µm '
        '(restore_tolerance)'
    )
    assert text_of(Contents(rest()), present(publisher='/other 03')) == (
        'another encoder, driver or file: the feedback comes from /other, which is not the '
        '/driver of before, and the encoder is incremental'
    )
    assert 'the host was started anew' in text_of(Contents(rest()), present(boot='boot 2'))
    assert text_of(Contents(rest()), present(configuration='d')).startswith(
        'configuration changed'
    )


def test_a_file_that_is_broken_or_of_another_machine_restores_nothing():
    whole = b''.join([line_of(Head('x', 'm')), line_of(rest())])
    assert isinstance(restored(read(whole, Head('x', 'm')), present(), parameters()), Restored)
    for place in range(len(whole)):  # any byte that is lost or broken
        for data in (whole[:place], whole[:place] + b'?' + whole[place + 1 :]):
            found = restored(read(data, Head('x', 'm')), present(), parameters())
            assert isinstance(found, Refused), place
    other = text_of(read(whole, Head('x', 'another')))
    assert other == 'another encoder, driver or file: it is of another machine'
    assert 'it is of axis x' in text_of(read(whole, Head('y', 'm')))  # axes swapped
    assert text_of(Contents()) == text_of(Contents(rest(homed=False))) == ''


def test_a_run_that_was_cut_restores_nothing():
    assert text_of(Contents(rest(homed=False, moving=True))).startswith(MOVED)


def test_a_single_turn_encoder_needs_a_brake_an_orderly_end_and_a_known_turn():
    new = present(publisher='/driver 02')
    changes = {'encoder': 'single_turn'}
    assert 'brake: false' in text_of(Contents(rest()), new, **changes, brake=False)
    assert 'encoder_turn' in text_of(Contents(rest()), new, **changes, encoder_turn=0.0)
    assert 'in order' in text_of(Contents(rest(ended=False)), new, **changes)
    same = restored(Contents(rest(ended=False)), present(), parameters(**changes, brake=False))
    assert isinstance(same, Restored)  # the driver has counted all the while
    wide = {**changes, 'restore_tolerance': 0.01}
    far = text_of(Contents(rest()), new._replace(position=0.12 + 0.3 * TURN), **wide)
    assert 'a quarter of encoder_turn' in far
    near = restored(Contents(rest()), new._replace(position=0.12 + 0.2 * TURN), parameters(**wide))
    assert near == Restored(0.1, 0.05, 2e-6)
    second = new._replace(position=0.12 - 3 * TURN)  # it counts its turns from 0
    found = restored(Contents(rest()), second, parameters(**changes))
    assert found.offset == pytest.approx(0.05 - 3 * TURN)


def test_a_wrapped_joint_is_where_it_was_in_any_turn():
    p = parameters(unit='rad', travel=6.0, wrap=6.283185307179586)
    found = restored(Contents(rest()), present(position=0.12 - p.wrap), p)
    assert found.home == pytest.approx(0.1 - p.wrap)


# -- the hash of the configuration ----------------------------------------------------------------

#: What moves the origin; a new parameter belongs here or to NO_ORIGIN.
ORIGIN = {
    'home_type': 'HS',
    'home_direction': 'Negative',
    'joint': 'other',
    'unit': 'rad',
    'home_shift_distance': -0.01,
    'home_position': 0.3,
    'invert_hs_polarity': True,
    'invert_positive_ls_polarity': True,
    'invert_negative_ls_polarity': True,
    'invert_near_positive_ls_polarity': True,
    'invert_near_negative_ls_polarity': True,
    'invert_external_positive_ls_polarity': True,
    'invert_external_negative_ls_polarity': True,
    'multiple_z_pulse': 3,
    'z_pulse_arm_delay': 0.001,
    'open_loop_homing': True,
    'ls_direction': 'Reverse',
    'mechanical_end_detection_pos_diff': 0.001,
    'mechanical_end_detection_time': 0.1,
    'mechanical_end_detection_ignore_ls': True,
    'mechanical_end_detection_first_torque_limit': 10.0,
    'mechanical_end_detection_second_torque_limit': 10.0,
    'switches': ['home_switch'],
    'switch_latency': 0.001,
    'feedback_clock': 'stamp',
    'switch_clock': 'stamp',
    'wrap': 6.0,
    'encoder': 'absolute',
    'encoder_turn': 0.004,
}

#: A home that is applied by a service, and what may differ in that.
APPLIED = {
    'apply': 'service',
    'apply_service': '/drive/set_home',
    'apply_type': 'std_srvs/srv/SetBool',
    'apply_request': '{data: true}',
    'restore': 'never',
}
APPLYING = (
    {'apply_service': '/drive/set_zero'},
    {'apply_type': 'std_srvs/srv/Trigger', 'apply_request': '{}'},
    {'apply_request': '{data: false}'},
)


def test_every_parameter_moves_the_origin_or_does_not():
    names = {field.name for field in dataclasses.fields(AxisParameters)}
    assert names == set(ORIGIN) | set(APPLIED) | NO_ORIGIN
    assert not set(ORIGIN) & NO_ORIGIN


def test_the_hash_changes_with_what_moves_the_origin_and_comes_back():
    p = parameters()
    one = configuration_hash(p, 'x', {})
    others = [parameters(**{name: value}) for name, value in ORIGIN.items()]
    others += [parameters(**APPLIED), *(parameters(**{**APPLIED, **one}) for one in APPLYING)]
    found = {configuration_hash(other, other.joint or 'x', {}) for other in others}
    found |= {
        configuration_hash(p, 'y', {}),
        configuration_hash(p, 'x', {Input.HOME_SWITCH: '/a'}),
    }
    assert len(found) == len(ORIGIN) + 1 + len(APPLYING) + 2 and one not in found
    assert configuration_hash(parameters(), 'x', {Input.HOME_SWITCH: ''}) == one
    assert (
        configuration_hash(parameters(homing_velocity_fast=0.02, restore='never'), 'x', {}) == one
    )


# -- the keeper -----------------------------------------------------------------------------------


class Kept:
    """An axis on a simulated machine whose file is in memory, over restarts of its node."""

    def __init__(self, position=0.02, **changes):
        self.rig = rig('HSHS', restore='trust', **changes)
        self.contents = Contents()
        self.publisher, self.boot, self.time = '/driver 01', 'boot 1', 1.7e9
        self.plant = None
        self.start(position)

    def start(self, position=None):
        """Start the node; its driver has been there for a while."""
        self.made = self.rig.rehearsal(1, position)
        if self.plant is not None:
            self.made = self.rig.rehearsal(1, self.plant.position)
        self.axis, self.plant = self.made.axis, self.made.plant
        self.keeper = Keeper(self.axis, self.hash, self.contents, self.boot, lambda: self.time)
        for _ in range(100):
            self.made.cycle()
        self.keeper.look(self.publisher)
        return self.keeper.restore(True)

    @property
    def hash(self):
        return configuration_hash(self.axis.parameters, 'x', {})

    def write(self):
        snapshot = self.keeper.snapshot()
        self.contents = Contents(snapshot.rest, snapshot.runs)

    def end(self):
        self.keeper.ended = True
        self.write()

    def home(self):
        self.keeper.look(self.publisher)
        outcome = self.made.home(limit=60.0).outcome
        self.time += 60.0
        return outcome


def test_a_home_survives_a_restart_and_the_first_quick_run_knows_the_switch():
    kept = Kept(rehome=True)
    first = kept.home()
    assert kept.axis.home_source == 'run' and str(kept.axis.kind) == 'home'
    kept.end()
    found = kept.start()
    assert isinstance(found, Restored)
    assert kept.axis.homed and kept.axis.home_source == 'restored'
    assert kept.axis.outcome.home_offset == first.home_offset
    assert kept.axis.outcome.uncertainty == first.uncertainty
    again = kept.home()
    assert str(kept.axis.kind) == 'rehome'
    # it replaces the home, and adds nothing
    assert again.home_offset == pytest.approx(first.home_offset, abs=1e-4)
    assert [run.number for run in kept.keeper.memory.runs] == [1, 2]
    assert [run.kind for run in kept.keeper.memory.runs] == ['home', 'rehome']


def test_a_restarted_driver_of_an_incremental_encoder_forgets_where_the_switch_was():
    kept = Kept(rehome=True)
    kept.home()
    kept.end()
    kept.publisher = '/driver 02'
    found = kept.start()
    assert found.text.startswith(OTHER) and kept.keeper.refusal == found.text
    assert not kept.axis.homed and kept.axis.remembered is None
    kept.home()
    assert str(kept.axis.kind) == 'home'
    kept.publisher = '/driver 03'  # while the node lives
    kept.home()
    assert str(kept.axis.kind) == 'home'
    kept.home()
    assert str(kept.axis.kind) == 'rehome'


def test_an_absolute_encoder_knows_the_switch_whoever_publishes():
    kept = Kept(rehome=True, encoder='absolute')
    kept.home()
    kept.end()
    kept.publisher, kept.boot = '/driver 02', 'boot 2'
    assert isinstance(kept.start(), Restored)
    kept.home()
    assert str(kept.axis.kind) == 'rehome'


def test_what_is_kept_of_a_run():
    kept = Kept()
    outcome = kept.home()
    (run,) = kept.keeper.memory.runs
    assert run.home == outcome.home_position_raw and run.error == 'NoError'
    assert run.approach == pytest.approx(0.06, abs=1e-4)
    assert run.duration == pytest.approx(kept.made.course.duration, abs=0.05)
    assert (run.fast, run.slow) == (0.2, 0.05)
    assert run.time == 1.7e9
    edges = [(name, rises, way) for name, rises, way, _, _ in run.seen]
    assert edges == [
        ('home_switch', True, 1),
        ('home_switch', False, -1),
        ('home_switch', True, 1),
    ]
    assert all(abs(place - 0.06) < 1e-3 for _, _, _, place, _ in run.seen)
    assert kept.keeper.dirty
    kept.axis.home(kept.made.time)
    kept.axis.set_emergency_stop(True)
    kept.made.finish()
    failed = kept.keeper.memory.runs[-1]
    assert (failed.error, failed.home, failed.quantities) == ('EmergencyStop', None, {})


def test_latches_and_the_index_are_kept():
    made = rig('HSZPulse', z_pulse_distance_check=0.01).rehearsal(1, 0.02)
    keeper = Keeper(made.axis, 'c', Contents(), 'b', lambda: 0.0)
    keeper.look('/driver 01')
    made.home(limit=60.0)
    (run,) = keeper.memory.runs
    latches = {place for name, _, _, place, _ in run.seen if name == 'z_pulse'}
    assert sorted(latches) == pytest.approx([0.0233, 0.0333, 0.0433, 0.0533, 0.0633])
    assert run.pitch == pytest.approx(0.01)
    assert run.quantities['the distance from the switch to the index'][0] == pytest.approx(
        0.0033, abs=3e-4
    )


def test_home_change_limit_holds_over_a_restart_until_it_is_accepted():
    kept = Kept(encoder='absolute', home_change_limit=0.001)
    for _ in range(6):
        assert kept.home().success
    switch = kept.rig.layout.switches['home_switch']
    kept.rig = kept.rig.switched(home_switch=switch._replace(on_from=0.064, on_to=0.07))
    kept.end()
    kept.contents = kept.contents._replace(rest=None)
    kept.start()
    outcome = kept.home()
    assert outcome.error is Error.HomeMoved and not kept.axis.homed
    assert 'home moved by +4 mm since this run' in outcome.message
    assert 'more than 1 mm (home_change_limit)' in outcome.message
    assert '~/x/accept_home' in outcome.message
    assert kept.keeper.memory.runs[-1].error == 'HomeMoved'
    kept.end()
    kept.start()
    assert kept.home().error is Error.HomeMoved
    assert kept.axis.accept().home_position_raw == pytest.approx(0.064, abs=1e-3)
    assert kept.keeper.accept().accepted
    assert kept.axis.homed
    kept.end()
    kept.start()
    assert kept.home().success
    assert kept.home().success


def test_the_file_says_what_it_said_until_a_run_replaces_it():
    """Changed and changed back: the home of before is restored, for the proof still holds."""
    kept = Kept(encoder='absolute')
    kept.home()
    kept.end()
    before = kept.rig
    kept.rig = before.but(home_position=0.5)
    assert kept.start().text.startswith(CHANGED)
    kept.end()
    kept.rig = before
    assert isinstance(kept.start(), Restored)
    kept.rig = before.but(home_position=0.5)
    kept.end()
    assert kept.start().text.startswith(CHANGED)
    kept.home()
    kept.end()
    kept.rig = before
    assert kept.start().text.startswith(CHANGED)


def test_a_node_that_ends_during_a_run_restores_nothing():
    kept = Kept()
    kept.home()
    for _ in range(300):
        kept.made.cycle()
    assert kept.axis.home(kept.made.time) is None
    kept.write()
    assert kept.contents.rest.moving and not kept.contents.rest.homed
    assert kept.start().text == 'moved while off: the node ended during a run'


def test_a_verify_keeps_the_home_in_the_file_all_the_while():
    kept = Kept()
    kept.home()
    for _ in range(300):
        kept.made.cycle()
    assert kept.axis.home(kept.made.time, verify=True) is None
    kept.write()
    assert kept.contents.rest.homed and not kept.contents.rest.moving
    kept.made.finish()
    assert kept.keeper.memory.runs[-1].kind == 'verify'


def test_an_unknown_publisher_compares_no_raw_homes_of_an_incremental_encoder():
    kept = Kept()
    kept.publisher = ''
    kept.home()
    assert 'home' not in kept.keeper.memory.runs[-1].quantities
    kept = Kept(encoder='absolute')
    kept.publisher = ''
    kept.home()
    assert 'home' in kept.keeper.memory.runs[-1].quantities


def test_the_place_of_an_axis_that_others_move_is_noticed():
    kept = Kept()
    assert kept.keeper.displaced
    kept.write()
    assert not kept.keeper.displaced
    kept.axis.feedback(kept.made.time + 1.0, 0.05)
    assert kept.keeper.displaced
