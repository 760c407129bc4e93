# SPDX-License-Identifier: Apache-2.0
"""What holds for every type, direction, start, geometry and latency (section 11).

`HOMING_FUZZ=1 pytest test/test_invariants.py` looks longer.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import pytest
from core_rig import (
    AHEAD,
    END,
    EXTERNAL_AHEAD,
    HARDWARE_LIMIT_TYPES,
    HS,
    HS_OFF_TYPES,
    INDEX_TYPES,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    LIMIT_TYPES,
    NEAR_AHEAD,
    RELEASE_TYPES,
    TYPES,
    Rig,
    Spoilt,
    error_of,
    home_of,
    rig,
    spoilt,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.parameters.axis import DEFINITIONS
from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.states import Error, HomeType
from homing_node.rehearsal.link import Transport

#: How long a pause of a run may be, s; it does not count for the run's timeout.
LONGEST_PAUSE = 0.2


class Resumed(Spoilt):
    """A rehearsal in which somebody ends each pause, and whose driver stamps its switches late."""

    wait = 0  # cycles
    paused = 0
    pauses = 0

    def cycle(self):
        setpoint = super().cycle()
        self.paused = self.paused + 1 if self.axis.paused else 0
        if self.paused > self.wait:
            self.pauses += 1
            self.axis.resume()
        return setpoint


@dataclass(frozen=True)
class Scenario:
    """An axis, where it starts, after how many cycles a pause ends, and what is known of it."""

    one: Rig
    start: float
    wait: int = 0

    @property
    def parameters(self):
        return self.one.parameters()

    def home(self, direction=1):
        """Return the course of a run, and how long its pauses were at most, s."""
        late = self.parameters.switch_latency

        def stamped_late(one):
            return (one._replace(time=one.time + late) if isinstance(one.value, bool) else one,)

        made = spoilt(self.one, stamped_late, direction, self.start)
        made.__class__, made.wait = Resumed, self.wait
        return made.home(limit=60.0), made.pauses * (self.wait + 2) * made.period

    @property
    def interval(self):
        """The time between two samples of what locates an edge, at most, s."""
        t, on_command = self.one.transport, self.parameters.open_loop_homing
        return 1.0 / (min(t.update_rate, t.feedback_rate) if on_command else t.feedback_rate)

    @property
    def may_miss_the_turn(self):
        """Whether the axis may turn and come back to the edge between two feedback samples."""
        slow = self.interval > 0.002
        return self.parameters.immediate_stop_at_ls and slow and self.one.layout.lag == 0.0

    @property
    def may_be_told_late(self):
        """Whether the limit may come before a latch that lies ahead of it has come and counts."""
        limit, p = self.one.layout.switches.get(LIMIT_AHEAD), self.parameters
        searches = [p.pace(row.motion.pace) for row in p.procedure.rows.values() if row.latches]
        if limit is None or not searches:
            return False
        velocity, t = max(search[0] for search in searches), self.one.transport
        told = t.latch_delay + t.jitter + 2.0 / t.update_rate + 3.0 / t.feedback_rate
        return max(true_homes(self)) + told * velocity > limit.on_from

    @property
    def latency(self):
        """How long it takes until a command answers an edge, and a cycle more, s."""
        t = self.one.transport
        return (
            max(t.switch_delay, t.feedback_delay)
            + t.jitter
            + 3.0 / t.update_rate
            + 2.0 / t.feedback_rate
            + self.one.layout.lag
            + self.parameters.switch_latency
            + self.parameters.switch_debounce
        )


LENGTHS = st.floats(1e-5, 0.003)
RATES = st.sampled_from([50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0])
DELAYS = st.sampled_from([0.0, 0.0, 0.001, 0.0037, 0.01, 0.02])
TRANSPORTS = st.builds(
    Transport,
    st.sampled_from([100.0, 125.0, 250.0, 500.0]),
    RATES,
    DELAYS,
    DELAYS,
    DELAYS,
    DELAYS,
    st.integers(0, 99),
)


@st.composite
def scenarios(draw, home_type):
    """Give an axis that a healthy run homes, whatever its start."""
    home_type = HomeType(home_type)
    fast = draw(st.floats(0.05, 0.3))
    slow = fast * draw(st.floats(0.2, 1.0))
    jerk = draw(st.sampled_from([200.0, 1000.0, 5000.0]))

    def deceleration():  # stops within 1 to 4 mm, less what the jerk costs
        return fast**2 / 2 / draw(st.floats(0.001, 0.004))

    values: dict[str, object] = {
        'homing_velocity_fast': fast,
        'homing_velocity_slow': slow,
        'max_jerk': jerk,
        'home_shift_velocity': draw(st.floats(0.05, 0.3)),
        'home_position': 0.0,
        'following_error': 0.08,
        'wrong_direction_distance': 0.0,
        'homing_reverse_distance': draw(st.sampled_from([0.0, 0.001, 0.01])),
        'home_shift_distance': draw(st.sampled_from([0.0, 0.0, -0.003])),
        'immediate_stop_at_ls': draw(st.booleans()),
        'edge_tolerance': 0.003,
        'switch_debounce': (debounce := draw(st.sampled_from([0.0, 0.0, 0.002, 0.01]))),
        'switch_latency': draw(st.sampled_from([0.0, 0.0, 0.003, 0.012])),
        'pause_mode': draw(st.booleans()),
        'all_ls_during_homing': draw(st.booleans()),
    }
    if home_type in ('HSHS', 'HSTouchProbe'):
        values['repeat'] = draw(st.sampled_from([1, 1, 2, 3]))
    for name in ('homing_velocity_fast', 'homing_velocity_slow', 'home_shift'):
        values[f'{name}_acc'], values[f'{name}_dec'] = deceleration(), deceleration()
    transport = draw(TRANSPORTS)
    hysteresis = draw(st.sampled_from([0.0, 0.0, 1e-5, 5e-4]))
    one = rig(home_type, **values).but(transport)
    ends = 'Detection' in home_type
    if ends:
        one = one.but(mechanical_end_detection_pos_diff=0.02)
    limit = draw(st.floats(0.080, 0.098))
    flags = {}
    if HS in one.layout.switches:
        low = draw(st.floats(0.050, 0.060))
        least = 0.004 if home_type in HS_OFF_TYPES else 1e-5
        width = draw(st.floats(max(least, 1.5 * fast * debounce), 0.015))
        flags[HS] = SwitchLayout(low, 1.0 if ends else low + width, hysteresis)
    for name in (LIMIT_AHEAD, NEAR_AHEAD, EXTERNAL_AHEAD):
        if name in one.layout.switches:
            hardware = name == LIMIT_AHEAD and home_type not in HARDWARE_LIMIT_TYPES
            at = 0.2 if hardware and home_type in LIMIT_TYPES else limit
            flags[name] = SwitchLayout(at, 1.0, hysteresis)
    flags[LIMIT_BEHIND] = SwitchLayout(-1.0, -0.01)
    one = one.switched(**flags)
    lag = draw(st.sampled_from([0.0, 0.0, 0.003, 0.02]))
    if lag == 0.0:  # else the command is not where the axis is
        one = one.but(open_loop_homing=draw(st.booleans()))
    probe = None if one.layout.touch_probe is None else draw(st.floats(0.0605, 0.075))
    one = one.built(
        hard_stops=(-0.3, END if ends else 1.0),
        lag=lag,
        touch_probe=probe,
        index_pitch=draw(st.floats(0.0021, 0.004)) if one.layout.index_pitch else 0.0,
        index_offset=draw(st.floats(-0.01, 0.01)),
    )
    last = {HomeType.TouchProbe: 0.06, HomeType.ZPulse: limit - 0.005}.get(home_type, 0.0979)
    edges = [edge for flag in flags.values() for edge in (flag.on_from, flag.on_to)]
    start = draw(
        st.floats(0.07 if ends else 0.03, last)
        | st.sampled_from(
            [0.07, *(edge for edge in edges if 0.07 < edge < last)]
            if ends
            else [0.03, *(edge for edge in edges if 0.0 < edge < last)]
        )
    )
    wait = draw(st.integers(0, round(LONGEST_PAUSE * transport.update_rate)))
    return Scenario(one, start, wait)


def pulses_after(scenario, edge, way):
    """Return the pulses that may be the first after an edge, as well as the edge is known."""
    layout = scenario.one.layout
    unsure = scenario.parameters.homing_velocity_fast * scenario.interval
    pulses = [layout.index_offset + k * layout.index_pitch for k in range(-20, 70)]
    ahead = sorted((p - edge) * way for p in pulses if (p - edge) * way > -unsure - 1e-9)
    count = sum(distance <= unsure + 1e-9 for distance in ahead) + 1
    return [edge + way * distance for distance in ahead[:count]]


def true_homes(scenario):
    """Return the home positions that are right."""
    one, kind = scenario.one, scenario.one.home_type
    flags, layout = one.layout.switches, one.layout
    hs = flags.get(HS)
    limit = {'L': LIMIT_AHEAD, 'N': NEAR_AHEAD, 'E': EXTERNAL_AHEAD}.get(kind[0], LIMIT_AHEAD)
    edge = flags[limit].on_from if limit in flags else AHEAD.on_from
    if kind in ('HS', 'HSHS'):
        return [hs.on_from]
    if kind == 'HSOff':
        return [hs.on_to + hs.hysteresis]
    if kind == 'HSReverse':
        return [hs.on_from - hs.hysteresis]
    if kind == 'HSOffReverse':
        return [hs.on_to]
    if kind in RELEASE_TYPES:
        return [edge - flags[limit].hysteresis]
    if kind in LIMIT_TYPES and kind not in INDEX_TYPES:
        return [edge]
    if kind in ('HSTouchProbe', 'TouchProbe'):
        return [layout.touch_probe]
    if kind == 'MechanicalEndDetection':
        return [END]
    if kind == 'MechanicalEndDetectionHS':
        return [hs.on_from - hs.hysteresis]
    if kind == 'MechanicalEndDetectionLS':
        return [flags[LIMIT_AHEAD].on_from - flags[LIMIT_AHEAD].hysteresis]
    arming, way = {
        'HSZPulse': lambda: (hs.on_from, 1),
        'HSReverseZPulse': lambda: (hs.on_from - hs.hysteresis, -1),
        'HSOffZPulse': lambda: (hs.on_to + hs.hysteresis, 1),
        'HSOffReverseZPulse': lambda: (hs.on_to, -1),
        'ZPulse': lambda: (scenario.start, 1),
        'MechanicalEndDetectionReverseZPulse': lambda: (END, -1),
    }.get(kind, lambda: (edge - flags[limit].hysteresis, -1))()
    return pulses_after(scenario, arming, way)


def assert_smooth(scenario, course):
    """Assert that setpoints are continuous and keep the limits of the parameters."""
    p, period = scenario.parameters, 1.0 / scenario.one.transport.update_rate
    velocity = max(p.homing_velocity_fast, p.home_shift_velocity) * (1 + 1e-6)
    acceleration = (1 + 1e-6) * max(
        getattr(p, name)
        for name in (
            'homing_velocity_fast_acc',
            'homing_velocity_fast_dec',
            'homing_velocity_slow_acc',
            'homing_velocity_slow_dec',
            'home_shift_acc',
            'home_shift_dec',
            'ls_dec',
        )
    )
    free = p.immediate_stop_at_ls  # to stop at once, where a limit changes the state
    for one, two in pairwise(course.samples):
        assert abs(two.velocity) <= velocity
        assert abs(two.acceleration) <= acceleration
        moved = two.position - one.position
        if one.state == two.state or not free:
            low, high = sorted((one.velocity, two.velocity))
            slack = acceleration * period**2
            assert low * period - slack <= moved <= high * period + slack
            assert abs(two.velocity - one.velocity) <= acceleration * period + 1e-9
            assert abs(two.acceleration - one.acceleration) <= (
                p.max_jerk * period * (1 + 1e-4) + 1e-6
            )
    if course.samples:
        first, last = course.samples[0], course.samples[-1]
        assert abs(first.position - scenario.start) <= velocity * period
        assert last.velocity == 0.0


def assert_kept_from_limit(scenario, course):
    """Assert that no setpoint went further past the limit than a stop from its edge takes."""
    flag, p = scenario.one.layout.switches.get(LIMIT_AHEAD), scenario.parameters
    if flag is None or scenario.start >= flag.on_from or p.homes_on_mechanical_end:
        return
    furthest = max((s.position for s in course.samples), default=scenario.start)
    v = p.homing_velocity_fast
    gentle = min(p.homing_velocity_fast_acc, p.homing_velocity_fast_dec, p.ls_dec)
    hard = max(p.homing_velocity_fast_acc, p.homing_velocity_fast_dec, p.ls_dec)
    stop = v**2 / 2 / gentle + v * gentle / 2 / p.max_jerk
    still_accelerating = v * hard / p.max_jerk
    assert furthest <= flag.on_from + stop + still_accelerating + v * scenario.latency


@pytest.mark.parametrize('home_type', [t for t in TYPES if t != 'CurrentPos'], ids=str)
@settings(max_examples=max(1, settings.default.max_examples // 15))
@given(data=st.data())
def test_invariants(home_type, data):
    scenario = data.draw(scenarios(home_type))
    course, paused = scenario.home()
    p = scenario.parameters
    if error_of(course) is Error.NoError:
        found, unsure = home_of(course), course.outcome.uncertainty
        fastest = p.homing_velocity_fast
        open_for = p.switch_stamp_error + scenario.interval
        most = fastest * open_for * (1 + 1e-6) + 1e-12
        if unsure > most:  # an edge less sure than its distance from a pulse leaves whole pitches
            assert 'ZPulse' in home_type and 'the Z-pulse' in ' '.join(course.outcome.warnings)
            most = 2.0 * most + max(scenario.one.layout.index_pitch, p.search_distance)
        assert unsure <= most
        assert min(abs(found - home) for home in true_homes(scenario)) <= unsure + 1e-7
        assert course.samples[-1].position == pytest.approx(
            found + p.home_shift_distance, abs=1e-12
        )
    else:
        assert scenario.may_miss_the_turn or (
            scenario.may_be_told_late and error_of(course) is Error.LSTriggered
        ), course.outcome.message
    assert course.duration <= p.run_timeout + paused
    assert_smooth(scenario, course)
    assert_kept_from_limit(scenario, course)

    mirrored, _ = scenario.home(-1)
    assert [(s.state, -s.position, -s.velocity) for s in mirrored.samples] == [
        (s.state, s.position, s.velocity) for s in course.samples
    ]
    assert mirrored.outcome.home_position_raw == -course.outcome.home_position_raw


@pytest.mark.parametrize('home_type', [t for t in TYPES if t != 'CurrentPos'], ids=str)
@settings(max_examples=max(1, settings.default.max_examples // 70))
@given(data=st.data())
def test_scaling_all_lengths_scales_the_run(home_type, data):
    scenario = data.draw(scenarios(home_type))
    one, scale = scenario.one, 4.0
    layout = one.layout
    large = one.but(
        **{
            name: value * scale
            for name, value in one.values.items()
            if DEFINITIONS[name].unit.startswith('m')
        }
    )
    large = large.built(
        hard_stops=tuple(scale * stop for stop in layout.hard_stops),
        switches={
            name: SwitchLayout(flag.on_from * scale, flag.on_to * scale, flag.hysteresis * scale)
            for name, flag in layout.switches.items()
        },
        index_pitch=layout.index_pitch * scale,
        index_offset=layout.index_offset * scale,
        touch_probe=None if layout.touch_probe is None else layout.touch_probe * scale,
    )
    course, _ = scenario.home()
    scaled, _ = replace(scenario, one=large, start=scenario.start * scale).home()
    assert error_of(scaled) is error_of(course)
    assert scaled.outcome.home_position_raw == pytest.approx(
        scale * course.outcome.home_position_raw, abs=1e-7
    )
    assert [s.state for s in scaled.samples] == [s.state for s in course.samples]
    for small, large_one in zip(course.samples, scaled.samples, strict=True):
        assert large_one.position == pytest.approx(scale * small.position, abs=1e-6)
