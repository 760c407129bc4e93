# SPDX-License-Identifier: Apache-2.0
"""Parameter files: the examples home as they stand, and a file reads here as it does in ROS."""

from math import isnan, pi
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from homing_node.parameters.definition import InvalidParameters
from homing_node.parameters.line import line
from homing_node.parameters.yaml_file import load, read
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Error
from homing_node.rehearsal.run import rehearse
from homing_node.ros.simulated.settings import settings_from

CONFIG = Path(__file__).resolve().parent.parent / 'config'
HYSTERESIS = 0.00005


# -- the examples ---------------------------------------------------------------------------------


def closed(low, high):
    """Return a normally closed switch."""
    return SwitchLayout(low, high, HYSTERESIS, inverted=True)


def homes_negative(travel, index_offset):
    """Return an axis with limits at its ends, a home switch near the lower one, and an index."""
    return AxisLayout(
        (-0.005, travel + 0.005),
        {
            'negative_limit_switch': SwitchLayout(-1.0, 0.0),
            'positive_limit_switch': SwitchLayout(travel, 1.0),
            'home_switch': SwitchLayout(0.02, 0.03, HYSTERESIS),
        },
        index_pitch=0.01,
        index_offset=index_offset,
        lag=0.005,
        start=0.1,
    )


def simulated_axes():
    return settings_from(read(CONFIG / 'simulated_axes.yaml', '/simulated_axes').values).layouts


#: The machine that each example fits, and where its home is, raw.
MACHINES = {
    'one_axis.yaml': lambda: {'x': (simulated_axes()['x'], 0.150)},
    'demo.yaml': lambda: {
        axis: (simulated_axes()[axis], home)
        for axis, home in {'x': 0.150, 'y': 0.0563, 'z': 0.150}.items()
    },
    'homed_machine.yaml': lambda: MACHINES['demo.yaml'](),
    'xyz.yaml': lambda: {
        'x': (homes_negative(0.4, 0.004), 0.034),
        'y': (homes_negative(0.3, 0.0065), 0.0365),
        'z': (
            AxisLayout(
                (-0.003, 0.123),
                {
                    'negative_limit_switch': SwitchLayout(-1.0, 0.0),
                    'positive_limit_switch': SwitchLayout(0.119, 1.0),
                    'home_switch': SwitchLayout(0.105, 0.111, HYSTERESIS),
                },
                lag=0.005,
                start=0.115,
            ),
            0.105,
        ),
    },
    'rotary_index.yaml': lambda: {
        'c': (AxisLayout((-50.0, 50.0), {}, index_pitch=2 * pi, index_offset=1.0, lag=0.005), 1.0)
    },
    'near_external.yaml': lambda: {
        'x': (
            AxisLayout(
                (0.0, 0.3),
                {
                    'negative_limit_switch': closed(-1.0, 0.01),
                    'external_negative_limit_switch': closed(-1.0, 0.02),
                    'near_negative_limit_switch': closed(-1.0, 0.03),
                    'near_positive_limit_switch': closed(0.27, 1.0),
                    'external_positive_limit_switch': closed(0.28, 1.0),
                    'positive_limit_switch': closed(0.29, 1.0),
                },
                lag=0.005,
                start=0.1,
            ),
            0.27,
        )
    },
}


@pytest.mark.parametrize('name', MACHINES)
def test_example_homes_as_it_stands(name):
    configuration, machine = load(CONFIG / name), MACHINES[name]()
    assert set(configuration.axes) == set(machine)
    for axis, (layout, home) in machine.items():
        course = rehearse(configuration.axes[axis], layout)
        assert course.outcome.error is Error.NoError, course.outcome
        assert course.outcome.home_position_raw == pytest.approx(home, abs=1e-5)


def test_every_example_is_tested():
    assert {f.name for f in CONFIG.glob('*.yaml')} == {
        *MACHINES,
        'simulated_axes.yaml',
        'line.yaml',
        'gantry.yaml',  # test_gantry_parameters.py
        'simulated_gantry.yaml',  # test_gantry_rehearsal.py
    }


def test_the_line_names_axes_of_the_demo():
    found = line(read(CONFIG / 'line.yaml', '/homing_coordinator').values)
    axes = {f'{cell}/{axis}' for cell in found.nodes for axis in load(CONFIG / 'demo.yaml').axes}
    assert {axis for step in found.steps for axis in step} == axes


def test_order_of_the_xyz_machine():
    assert load(CONFIG / 'xyz.yaml').home_sequence == (('z',), ('x', 'y'))


# -- what rcl makes of a file ---------------------------------------------------------------------


def by_rcl(path):
    """Return the parameters that rcl reads for /homing_node; an empty list is not set then."""
    context = Context()
    rclpy.init(
        args=['--ros-args', '--params-file', str(path)],
        context=context,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    try:
        node = Node(
            'homing_node', context=context, enable_rosout=False, start_parameter_services=False
        )
        found = {name: p.value for name, p in node._parameter_overrides.items()}
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    return found


def plain(values):
    """Make values comparable: a kind beside each, a list as a list, NaN as a word."""

    def one(value):
        if value is not None and hasattr(value, '__iter__') and not isinstance(value, str):
            return [one(item) for item in value]
        nan = isinstance(value, float) and isnan(value)
        return type(value).__name__, 'nan' if nan else value

    return {name: one(value) for name, value in values.items()}


SCALARS = """\
/**:
  ros__parameters:
    octal: 010
    not_octal: 08
    hexadecimal: 0x1F
    signed: +5
    small: 1e-3
    bare: .5
    point: 5.
    negative: -.5E-2
    largest: 9223372036854775807
    larger: 9223372036854775808
    huge: 1e400
    tiny: -1e-310
    zero: 0.e999
    infinite: .inf
    no_number: nan
    truth: y
    off: off
    quoted: "y"
    word: 'off'
    grouped: 1_000
    minutes: 1:30
    date: 2020-01-01
    nothing: null
    tilde: ~
    block: |
      5
    empty_list: []
    anchor: &name 1
    list: ['x', 'y']
    numbers: [1.0, 2.5]
    x:
      y: {z: 1}
      travel: 0.4
    x.travel: 0.5
    qos_overrides:
      /homing_node/x/home_switch: {subscription: {durability: transient_local}}
"""


def test_values_are_read_as_rcl_reads_them(tmp_path):
    path = tmp_path / 'scalars.yaml'
    path.write_text(SCALARS)
    assert plain(read(path).values) == {**plain(by_rcl(path)), 'empty_list': []}


@pytest.mark.parametrize(
    'name',
    [
        'homing_node',
        '/homing_node',
        '/**',
        '/*',
        '/**/homing_node',
        '/**/*',
        '/*/homing_node',
        '/cell/homing_node',
        'other',
        '/**/other',
        '/:\n  homing_node',
        '/**:\n  homing_node',
    ],
)
def test_blocks_are_chosen_as_rcl_chooses_them(tmp_path, name):
    path = tmp_path / 'blocks.yaml'
    indent = '    ' if '\n' in name else '  '
    path.write_text(f'{name}:\n{indent}ros__parameters:\n{indent}  a: 1\n')
    try:
        found = read(path).values
    except InvalidParameters:
        found = {}
    assert found == by_rcl(path)


def test_last_block_wins(tmp_path):
    path = tmp_path / 'two.yaml'
    path.write_text(
        'homing_node:\n  ros__parameters: {a: 1, b: 1}\n/**:\n  ros__parameters: {b: 2}\n'
    )
    assert read(path).values == by_rcl(path) == {'a': 1, 'b': 2}


MALFORMED = {
    'mixed list': (b'/**:\n  ros__parameters:\n    axes: [x, y]\n', 3, 'quote the names'),
    'integers among reals': (
        b'/**:\n  ros__parameters:\n    a: [1, 2.0]\n',
        3,
        'a list of float and int',
    ),
    'no value': (b'/**:\n  ros__parameters:\n    a: 1\n    b:\n', 4, 'b: no value'),
    'empty mapping': (b'/**:\n  ros__parameters:\n    a: {}\n    b: 1\n', 3, 'a: no value'),
    'lists in a list': (
        b"/**:\n  ros__parameters:\n    home_sequence: [['z'], ['x', 'y']]\n",
        3,
        "home_sequence: a list holds no lists; write each as one string: ['z', 'x, y']",
    ),
    'alias': (b'/**:\n  ros__parameters:\n    a: &q 1\n    b: *q\n', 4, 'no aliases'),
    'open quote': (b'/**:\n  ros__parameters:\n    a: "open\n', 4, 'quoted scalar'),
    'tab': (b'/**:\n  ros__parameters:\n\ta: 1\n', 3, 'cannot start any token'),
    'no block': (b'travel: 1\n', 1, "expected a node's name"),
    'a list': (b'- 1\n- 2\n', 1, "expected a node's name"),
    'empty block': (b'/**:\n  ros__parameters:\n', 2, 'expected names and values'),
    'not UTF-8': (b'/**:\n  ros__parameters:\n    a: caf\xe9\n', 3, 'not UTF-8'),
    'control character': (b'/**:\n  ros__parameters:\n    a: "\x07"\n', 3, 'not allowed'),
}


def test_a_name_that_stands_twice(tmp_path):
    """The node would take the last one, unseen."""
    path = tmp_path / 'axes.yaml'
    path.write_text('/**:\n  ros__parameters:\n    a: 1\n    a: 2\n')
    with pytest.raises(InvalidParameters, match=':4: a stands there twice'):
        load(path)


@pytest.mark.parametrize('name', MALFORMED)
def test_malformed_file(tmp_path, name):
    data, line, text = MALFORMED[name]
    path = tmp_path / 'axes.yaml'
    path.write_bytes(data)
    with pytest.raises(InvalidParameters) as caught:
        load(path)
    (fault,) = caught.value.faults
    assert fault.startswith(f'{path}:{line}: ') and text in fault
    with pytest.raises(rclpy._rclpy_pybind11.RCLError):
        by_rcl(path)


@pytest.mark.parametrize(
    ('data', 'text'),
    [
        (None, 'No such file or directory'),
        (b'', 'no parameters for /homing_node'),
        (
            b'other:\n  ros__parameters: {a: 1}\n',
            'no parameters for /homing_node, only for /other',
        ),
    ],
)
def test_nothing_for_the_node(tmp_path, data, text):
    path = tmp_path / 'axes.yaml'
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InvalidParameters) as caught:
        load(path)
    assert caught.value.faults == (f'{path}: {text}',)


def test_a_file_that_is_nested_too_deeply(tmp_path):
    path = tmp_path / 'axes.yaml'
    path.write_text('[' * 5000)
    with pytest.raises(InvalidParameters, match='nested too deeply'):
        load(path)


def test_another_namespace(tmp_path):
    path = tmp_path / 'axes.yaml'
    path.write_text(
        '/cell/homing_node:\n  ros__parameters:\n    axes: ["x"]\n'
        '    x: {home_type: CurrentPos, travel: 1}\n'
    )
    assert load(path, '/cell/homing_node').axes['x'].travel == 1.0
    assert load(path, 'cell/homing_node').axes['x'].travel == 1.0


def test_the_simulated_axes_say_every_fault():
    with pytest.raises(InvalidParameters) as caught:
        settings_from(
            {
                'axes': ['x', 'y'],
                'x.hard_stops': [0.0, 0.2],
                'x.joint': 'j',
                'y.joint': 'j',
                'z.lag': 0.1,
                'z.start': 0.1,
                'feedback_rate': 0,
                'dead_time': 0.001,
                'setpoint_interface': 'velocity',
                'steprate': 1000.0,
                'use_sim_time': True,
            }
        )
    assert caught.value.faults == (
        'feedback_rate: 0.0 Hz must be >= 1 and <= 5000 Hz',
        "setpoint_interface: 'velocity' is none of trajectory, position, dof",
        "steprate: no such parameter; did you mean 'step_rate'?",
        "z: 'z' is none of the axes x, y: add it to axes, or delete its parameters",
        'use_sim_time: must be false, the simulated axes run in real time',
        'dead_time: 0.001 s must be >= 2 steps, 0.002 s (step_rate)',
        'joint: two axes have the same joint: j, j',
        'y.hard_stops: required, but not set (the lower and the upper end, m or rad)',
    )


@pytest.mark.parametrize(
    ('name', 'value', 'said'),
    [
        ('switch_rate', -1.0, '-1.0 Hz must be 0 or >= 0.1 and <= 5000 Hz'),
        ('switch_jitter', 1.0, '1.0 must be >= 0 and <= 0.9'),
        ('switch_heartbeat', 4000.0, '4000.0 s must be 0 or >= 0.001 and <= 3600 s'),
        ('feedback_read_rate', 0.01, '0.01 Hz must be 0 or >= 0.1 and <= 5000 Hz'),
        ('header_clock_offset', 1e7, '10000000.0 s must be >= -1e+06 and <= 1e+06 s'),
        ('second_source', True, 'True is not a number (Hz)'),
        ('second_source_position', 'a', "'a' is not a number (m or rad)"),
        ('x.switch_rate', 9999.0, '9999.0 Hz must be 0 or >= 0.1 and <= 5000 Hz'),
    ],
)
def test_bad_values_of_the_simulated_drivers(name, value, said):
    with pytest.raises(InvalidParameters) as caught:
        settings_from({'axes': ['x'], 'x.hard_stops': [0.0, 0.2], name: value})
    assert caught.value.faults == (f'{name}: {said}',)


def test_the_switches_of_simulated_axes_are_read_at_the_rate_of_their_axis():
    axes = {'axes': ['x', 'y'], 'x.hard_stops': [0.0, 0.2], 'y.hard_stops': [0.0, 0.2]}
    found = settings_from({**axes, 'switch_rate': 50, 'y.switch_rate': 0.0}).layouts
    assert (found['x'].switch_rate, found['y'].switch_rate) == (50.0, 0.0)
    with pytest.raises(InvalidParameters, match='a polled switch has no heartbeat'):
        settings_from({**axes, 'switch_rate': 50, 'switch_heartbeat': 1.0})


def test_a_simulated_gantry():
    given = {
        'axes': ['x', 'y'],
        'x.hard_stops': [0.0, 0.2],
        'y.hard_stops': [0.0, 0.2],
        'y.joint': 'y1_joint',
        'y.followers': ['y2', 'y3'],
        'y.y2.stiffness': 1e6,
        'y.y2.joint': 'y2_joint',
        'y.y3.stiffness': 1e5,
        'y.y3.switch_rate': 0.0,
        'switch_rate': 50.0,
    }
    found = settings_from(given)
    assert list(found.layouts) == ['x', 'y']
    assert list(found.sides) == ['x', 'y', 'y.y2', 'y.y3']
    assert found.joints == ['x', 'y1_joint', 'y2_joint', 'y3']
    assert [one.switch_rate for one in found.sides.values()] == [50.0, 50.0, 50.0, 0.0]
    with pytest.raises(InvalidParameters) as caught:
        settings_from({**given, 'y.y2.joint': 'x', 'y.y4.lag': 0.1, 'y.y3.stiffness': -1.0})
    assert caught.value.faults == (
        'joint: two axes have the same joint: x, y1_joint, x, y3',
        "y.y4: 'y4' is none of the followers of y: add it to y.followers, or delete its keys",
        'y.y3.stiffness: -1.0 N/m must be >= 0 and <= 1e+12 N/m',
    )


@pytest.mark.parametrize('axes', [None, [], ['x', 'x'], [1], ['2x'], 'x'])
def test_the_simulated_axes_need_names(axes):
    with pytest.raises(InvalidParameters, match='axes: '):
        settings_from({'axes': axes, 'x.hard_stops': [0.0, 1.0]})


def test_faults_have_their_lines(tmp_path):
    path = tmp_path / 'axes.yaml'
    path.write_text("""\
/**:
  ros__parameters:
    axes: ['x', 'z']
    updaterate: 100
    x:
      home_type: HSHS
      travle: 0.4
      homing_velocity_fast: fast
    z:
      home_type: HS
      travel: 0.1
      homing_velocity_slow: 0.5
""")
    with pytest.raises(InvalidParameters) as caught:
        load(path)
    assert sorted(caught.value.faults) == sorted(
        [
            f"{path}:4: updaterate: no such parameter; did you mean 'update_rate'?",
            f"{path}:7: x.travle: no such parameter; did you mean 'travel'?",
            f"{path}:8: x.homing_velocity_fast: 'fast' is not a number (m/s)",
            f'{path}:5: x.travel: required, but not set (mechanical travel of the axis, m)',
            f'{path}:12: z.homing_velocity_slow: 0.5 m/s must be <= homing_velocity_fast, '
            '0.05 m/s',
        ]
    )
