# SPDX-License-Identifier: Apache-2.0
"""`homing survey` against the core and a simulated plant, without ROS: what it asks and writes."""

import io
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest
from core_rig import HOME, HS, LIMIT_AHEAD, rig

from homing_node.cli import main, survey
from homing_node.cli.common import Failure
from homing_node.core.jog import Jog
from homing_node.parameters.axis import DEFINITIONS
from homing_node.plant import layout_file
from homing_node.procedures.states import LIMIT_SWITCHES, Error
from homing_node.rehearsal.run import Rehearsal


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, after which the axis is known to rest."""


class Client:
    """What the verb needs of a HomingClient, of an axis that is rehearsed."""

    def __init__(self, made):
        self.made, self.set, self.jogs = made, {}, []
        self.cut = None  # what ends which jog, and whether the axis is then known to rest
        made.home()
        made.axis.homed = False

    def parameters(self, *names):
        if names == ('axes',):
            return {'axes': ['x']}
        p = self.made.axis.parameters
        values = {name: getattr(p, name.removeprefix('x.')) for name in names}
        return {
            name: [str(one) for one in value] if isinstance(value, tuple) else value
            for name, value in values.items()
            if value is not None and value != DEFINITIONS[name.removeprefix('x.')].default
        }

    def state(self, axis):
        one = self.made.axis
        levels = {False: 0, True: 1, None: 2}
        return SimpleNamespace(
            state=str(one.state),
            position=one.raw_position,
            homed=False,
            home_offset=0.0,
            following_error=one.following_error,
            inputs=[str(name) for name, _ in one.levels],
            levels=[levels[level] for _, level in one.levels],
        )

    def jog(self, axis, distance, velocity, held=None, on_feedback=None):
        self.jogs.append((distance, velocity))
        made = self.made
        cycle = made.cycle

        def told():
            setpoint = cycle()
            if made.axis.running:
                on_feedback(
                    SimpleNamespace(state=self.state('x'), distance_to_go=made.axis.distance_to_go)
                )
            return setpoint

        made.cycle = told
        try:
            outcome = made.jog(Jog(distance, velocity)).outcome
        finally:
            made.cycle = cycle
        result = SimpleNamespace(
            success=outcome.success,
            message='' if outcome.success else f'{outcome.error}: {outcome.message}',
            edges=outcome.jogged.edges if outcome.jogged else (),
            state=self.state('x'),
        )
        if self.cut and len(self.jogs) == self.cut[0]:
            ended = self.cut[1]
            if isinstance(ended, Interrupted):
                result.success, result.message = False, 'Canceled: axis x: canceled'
                ended.result = result
            raise ended
        return result

    def set_parameters(self, axis, **values):
        self.set.update(values)
        return SimpleNamespace(message='', __bool__=lambda self: True)


@pytest.fixture
def surveyed(monkeypatch, tmp_path, capsys):
    """Return what surveys a rig: the status, what was said, the client, and the file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(survey, '_rates', lambda node, axis: {})

    def run(one, *arguments, direction=1, cut=None):
        client = Client(one.rehearsal(direction))
        client.cut = cut

        @contextmanager
        def connected(_):
            try:
                yield client
            except TimeoutError as error:
                raise Failure(str(error), status=1) from None

        monkeypatch.setattr(survey, 'connected', connected)
        status = main(['survey', 'x', '--within', '0.06', *arguments])
        out, err = capsys.readouterr()
        return status, out, err, client

    return run


def test_it_writes_what_is_there(surveyed):
    one = rig('HS').built(lag=0.01)
    status, out, err, client = surveyed(one, '--velocity', '0.05', '--yes')
    assert (status, err) == (0, ''), out
    assert out.splitlines()[-1] == 'wrote x_layout.yaml'
    found = layout_file.load('x_layout.yaml').layouts['x']
    assert (found.switches[HS].on_from, found.switches[HS].on_to) == pytest.approx(
        (HOME.on_from, HOME.on_to), abs=3e-4
    )
    assert found.switches[LIMIT_AHEAD].on_from == pytest.approx(0.09, abs=3e-4)
    assert found.lag == pytest.approx(0.01, rel=0.1)
    velocities = {velocity for _, velocity in client.jogs}
    assert max(velocities) == 0.05 and len(velocities) == 2
    status, _, err, _ = surveyed(one, '--yes')
    assert status == 2 and 'x_layout.yaml is there already' in err


def test_by_default_it_goes_at_a_tenth_of_fast(surveyed):
    _, out, _, client = surveyed(rig('HS'), '--yes')
    assert max(velocity for _, velocity in client.jogs) == pytest.approx(0.02)
    assert 'axis x goes up to 60 mm both ways from 0.06' in out


def test_what_makes_no_sense_is_said(surveyed):
    one = rig('HS')
    flags = {
        name: flag._replace(inverted=name == HS) for name, flag in one.layout.switches.items()
    }
    status, out, _, client = surveyed(one.built(switches=flags), '--velocity', '0.05', '--yes')
    assert status == 1 and not client.set
    assert 'doubt: home_switch is ' in out and '(invert_hs_polarity: true)' in out


@pytest.mark.parametrize('answer', ['y', 'n', None])
def test_it_asks_whether_the_node_shall_get_what_makes_sense(surveyed, monkeypatch, answer):
    def answered(question):
        if answer is None:
            raise EOFError
        assert question == 'set x.invert_hs_polarity to true in the running node? [y/N] '
        return answer

    one = rig('HS')
    flags = dict(one.layout.switches)
    flags[HS] = flags[HS]._replace(inverted=True)
    monkeypatch.setattr('builtins.input', answered)
    monkeypatch.setattr('sys.stdin', SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(survey, 'HeldKey', lambda: nullcontext(SimpleNamespace(held=lambda: True)))
    status, out, _, client = surveyed(one.built(switches=flags), '--velocity', '0.05')
    assert status == 1 and 'hold any key down' in out
    assert client.set == ({'invert_hs_polarity': True} if answer == 'y' else {})
    assert ('is set until the node ends' in out) == (answer == 'y')


def test_a_motion_that_fails_ends_it_and_leaves_the_file(surveyed):
    one = rig('HS').but(travel=0.1, following_error=1e-6).built(lag=0.05)
    status, out, err, client = surveyed(one, '--velocity', '0.05', '--yes')
    assert status == 1 and err.startswith('homing: FollowingError: axis x: '), err
    assert len(client.jogs) == 1 and 'wrote x_layout.yaml' in out


@pytest.mark.parametrize('ended', [Interrupted(), KeyboardInterrupt(), TimeoutError('it is gone')])
def test_what_was_seen_is_kept_where_it_is_cut_short(surveyed, ended):
    """By Ctrl-C, by a second one, by a node that dies: a true file, which says it is not whole."""
    one = rig('HS').built(lag=0.01)
    wanted = one, '--velocity', '0.05', '--yes'
    status, out, err, _ = surveyed(*wanted, cut=(2, ended))
    gone = isinstance(ended, TimeoutError)
    assert (status, err) == (
        (1, 'homing: it is gone\n') if gone else (130, 'homing: interrupted\n')
    )
    assert out.splitlines()[-1] == 'wrote x_layout.yaml' and 'doubt' not in out
    assert ('ended there: it is gone' if gone else 'ended there, Canceled: ') in out
    text = Path('x_layout.yaml').read_text()
    assert 'and not to its end' in text and 'the survey ended there' in text
    found = layout_file.load('x_layout.yaml').layouts['x']
    assert found.switches[LIMIT_AHEAD].on_from == pytest.approx(0.09, abs=3e-3)


def test_a_survey_that_has_met_nothing_leaves_no_file(surveyed):
    one = rig('HS').built(start=0.03)
    arguments = '--velocity', '0.05', '--yes', '--within', '0.001'
    status, out, err, client = surveyed(one, *arguments, cut=(1, Interrupted()))
    assert (status, err) == (130, 'homing: interrupted\n')
    assert 'no edge was met till then: x_layout.yaml is not written' in out
    assert len(client.jogs) == 1 and not Path('x_layout.yaml').exists()


@pytest.mark.parametrize('home_type', ['NearLS', 'ExternalLS', 'MechanicalEndDetectionLS'])
def test_all_limit_switches_are_found(surveyed, home_type):
    """Near and external ones, and those before a hard stop at which an axis homes."""
    one = rig(home_type)
    status, out, err, client = surveyed(one, '--velocity', '0.05', '--yes')
    assert (status, err) == (0, ''), out
    found = layout_file.load('x_layout.yaml').layouts['x']
    start = client.made.axis.raw_position
    first = min(
        (flag.on_from, name)
        for name, flag in one.layout.switches.items()
        if name in LIMIT_SWITCHES and flag.on_from > start - 0.06
    )
    assert found.switches[first[1]].on_from == pytest.approx(first[0], abs=3e-4)
    assert found.switches[first[1]].on_to == inf
    assert 'not seen: negative_limit_switch: it stayed off' in out
    assert 'negative_limit_switch' in found.stays_off
    parameters = replace(client.made.axis.parameters, following_error=0.0)
    hard_stops = (found.hard_stops[0], one.layout.hard_stops[1])  # written in by hand
    course = Rehearsal(parameters, found._replace(hard_stops=hard_stops)).home()
    assert course.outcome.success, course.outcome.message
    true = Rehearsal(parameters, one.layout, position=found.start).home().outcome
    assert course.outcome.home_position_raw == pytest.approx(true.home_position_raw, abs=3e-4)


def test_a_hard_stop_in_the_way_is_no_doubt_about_a_switch(surveyed):
    """The axis homes at the stop, and begins on its home switch: nothing is known of that."""
    status, out, err, _ = surveyed(rig('MechanicalEndDetectionHS'), '--velocity', '0.05', '--yes')
    assert status == 1 and err.startswith('homing: FollowingError: axis x: ')
    assert 'doubt' not in out and 'FollowingError: FollowingError' not in out
    assert 'if it stands at a hard stop, write the stop into the file' in out
    assert 'home_switch: it was on between 0.07 and 0.098 m, which is not the whole way' in out


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['--velocity', '0'], '0 is not a number > 0'),
        ([], 'there is no terminal on which a key could be held: give --yes'),
    ],
)
def test_what_is_refused(surveyed, monkeypatch, capsys, arguments, said):
    monkeypatch.setattr('sys.stdin', io.StringIO())
    try:
        status, _, err, _ = surveyed(rig('HS'), *arguments)
    except SystemExit as end:
        status, err = end.code, capsys.readouterr().err
    assert status == 2 and said in err


def test_the_error_of_an_answer():
    assert survey._error('LSTriggered: axis x: it rose') is Error.LSTriggered
    assert survey._error('something else') is Error.InternalError
