# SPDX-License-Identifier: Apache-2.0
"""Other controllers' files: converted, checked, and rehearsed to where that controller homes.

The files in test/foreign have the values of public configurations. Where their controller homes,
and what the axis reads there, is written down here, from the controllers' own documentation.
"""

from pathlib import Path
from typing import NamedTuple

import pytest

from homing_node.check import check, errors
from homing_node.cli import main
from homing_node.convert import KINDS, Unconvertible, convert, yaml_text
from homing_node.convert.converted import Setting
from homing_node.parameters import yaml_file
from homing_node.parameters.axis import DEFINITIONS
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Input
from homing_node.rehearsal.run import rehearse

FOREIGN = Path(__file__).parent / 'foreign'
INCH = 0.0254

#: The switch covers the end of the axis from here on, m.
INTO, HYSTERESIS = 0.004, 0.0003
PITCH, OFFSET = 0.005, 0.0011
EVERY_FILE = sorted(path.name for path in FOREIGN.iterdir())

PRESS, RELEASE, INDEX, HERE = 'press', 'release', 'index after release', 'here'


class Homes(NamedTuple):
    """Where a controller homes an axis.

    Attributes:
        direction: 1 or -1, the end at which the switch is.
        edge: which edge of the switch, or the first index beyond it.
        reads: what the axis reads at that place, m or rad.
        rests: what it reads at the end of the run.
    """

    direction: int
    edge: str
    reads: float
    rests: float


#: (file, axis) -> where its controller homes.
CONTROLLER = {
    ('mill_inch.ini', 'x'): Homes(-1, RELEASE, 0.0, 0.0),
    ('mill_inch.ini', 'y'): Homes(-1, RELEASE, 0.0, 0.0),
    ('mill_inch.ini', 'z'): Homes(1, RELEASE, 0.0, 0.0),
    ('mill_inch.ini', 'a'): Homes(1, HERE, 0.0, 0.0),
    ('servo_router.ini', 'x'): Homes(1, RELEASE, 0.0, 0.0),
    ('servo_router.ini', 'y'): Homes(-1, RELEASE, 0.0, 0.0),
    ('servo_router.ini', 'z'): Homes(-1, RELEASE, 0.0, 0.0),
    ('knee_mill_index.ini', 'x'): Homes(-1, INDEX, 0.05 * INCH, 0.0),
    ('knee_mill_index.ini', 'y'): Homes(-1, INDEX, 0.0, 0.0),
    ('knee_mill_index.ini', 'z'): Homes(1, RELEASE, -0.225 * INCH, 0.0),
    ('ethercat_slide.ini', 'x'): Homes(-1, PRESS, -0.0005, 0.003),
    ('laser.grbl', 'x'): Homes(-1, PRESS, -0.130, -0.129),
    ('laser.grbl', 'y'): Homes(1, PRESS, 0.0, -0.001),
    ('sheet_router.grbl', 'x'): Homes(-1, PRESS, -1.3, -1.285),
    ('sheet_router.grbl', 'y'): Homes(-1, PRESS, -2.502, -2.487),
    ('sheet_router.grbl', 'z'): Homes(1, PRESS, 0.0, -0.015),
    ('bed_slinger.cfg', 'x'): Homes(-1, PRESS, 0.0, 0.0),
    ('bed_slinger.cfg', 'y'): Homes(-1, PRESS, 0.0, 0.0),
    ('bed_slinger.cfg', 'z'): Homes(-1, PRESS, 0.0, 0.0),
    ('large_printer.cfg', 'x'): Homes(-1, PRESS, -0.020, -0.020),
    ('large_printer.cfg', 'y'): Homes(1, PRESS, 0.306, 0.306),
    ('large_printer.cfg', 'z'): Homes(-1, PRESS, -0.0007, -0.0007),
    ('stepper_drives.yml', 'lift'): Homes(-1, RELEASE, 0.0, 0.0),
    ('stepper_drives.yml', 'turntable'): Homes(1, HERE, 0.0, 0.0),
}
#: (file, axis, or '' for the whole file) -> why it cannot be converted.
REFUSED = {
    ('knee_mill_index.ini', 'a'): 'MIN_LIMIT = 0.0, MAX_LIMIT = 0.0: no travel follows from it',
    ('mill_not_homing.grbl', ''): '$22=0: the homing cycle is off',
    ('sensorless_printer.cfg', 'x'): 'the driver detects a stall, there is no switch',
    ('sensorless_printer.cfg', 'y'): 'the driver detects a stall, there is no switch',
    ('sensorless_printer.cfg', 'z'): 'a probe that touches the bed',
    ('robot_drives.yml', 'joint_1'): '0x6098 is not set: the method is stored in the drive',
    ('robot_drives.yml', 'joint_2'): '0x6098 is not set: the method is stored in the drive',
}
#: The order in which the controllers home their axes.
SEQUENCES = {
    'mill_inch.ini': ['z', 'x, y, a'],
    'servo_router.ini': ['z', 'x, y'],
    'knee_mill_index.ini': ['z', 'x, y'],
    'laser.grbl': ['x, y'],
    'sheet_router.grbl': ['z', 'x, y'],
    'bed_slinger.cfg': ['x', 'y', 'z'],
    'large_printer.cfg': ['x', 'y', 'z'],
}


def converted(name):
    drives = name.endswith('.yml')  # their files have no travel
    return convert((FOREIGN / name).read_text(), travel=1.0 if drives else None)


def configuration(name, folder):
    """Convert a file and read what was written, as the node does."""
    path = folder / 'axes.yaml'
    path.write_text(yaml_text(converted(name), name))
    return yaml_file.load(path)


def layout_of(parameters, homes):
    """Return a machine whose switch covers the end at which it homes; raw positions from 0."""
    travel = parameters.travel
    low, high = sorted((-homes.direction * INTO, homes.direction))
    at = 0.0 if homes.direction < 0 else travel
    flag = SwitchLayout(at + low, at + high, HYSTERESIS)
    side = 'positive' if homes.direction > 0 else 'negative'
    other = 'negative' if homes.direction > 0 else 'positive'
    flags = {}
    for switch in parameters.switches:
        if switch in ('home_switch', f'{side}_limit_switch'):
            flags[str(switch)] = flag
        elif switch == f'{other}_limit_switch':
            end = travel - at
            flags[str(switch)] = SwitchLayout(end - 0.001, end + 1.0)
            if homes.direction > 0:
                flags[str(switch)] = SwitchLayout(end - 1.0, end + 0.001)
    indexed = Input.Z_PULSE in parameters.switches
    flags = {
        name: flag._replace(inverted=parameters.inverted(Input(name)))
        for name, flag in flags.items()
    }
    return AxisLayout(
        (-0.02, travel + 0.02),
        flags,
        index_pitch=PITCH if indexed else 0.0,
        index_offset=OFFSET,
        start=0.6 * travel,
        lag=0.002,
    )


def place_of(parameters, homes, start):
    """Return the raw position at which the controller homes."""
    at = 0.0 if homes.direction < 0 else parameters.travel
    press = at - homes.direction * INTO
    release = press - homes.direction * HYSTERESIS
    if homes.edge == HERE:
        return start
    if homes.edge == PRESS:
        return press
    if homes.edge == RELEASE:
        return release
    away = -homes.direction
    pulses = [OFFSET + k * PITCH for k in range(-3, 1000)]
    return min((p for p in pulses if (p - release) * away > 0.0), key=lambda p: abs(p - release))


def test_every_file_is_spoken_of():
    assert {name for name, _ in (*CONTROLLER, *REFUSED)} == set(EVERY_FILE)
    assert len(EVERY_FILE) >= 10


@pytest.mark.parametrize('name', sorted({name for name, _ in CONTROLLER}))
def test_what_is_converted_is_checked(name, tmp_path):
    made = configuration(name, tmp_path)
    assert set(made.axes) == {axis for file, axis in CONTROLLER if file == name}
    assert [finding.text for finding in errors(check(made))] == []
    if name in SEQUENCES:
        assert [', '.join(group) for group in made.home_sequence] == SEQUENCES[name]


@pytest.mark.parametrize(('name', 'axis'), CONTROLLER)
def test_it_homes_where_its_controller_does(name, axis, tmp_path):
    parameters = configuration(name, tmp_path).axes[axis]
    homes = CONTROLLER[name, axis]
    layout = layout_of(parameters, homes)
    course = rehearse(parameters, layout)
    outcome = course.outcome
    assert outcome.success, outcome.message
    place = place_of(parameters, homes, layout.start)
    assert abs(outcome.home_position_raw - place) <= outcome.uncertainty + 1e-9
    assert outcome.home_position_raw - outcome.home_offset == pytest.approx(homes.reads, abs=1e-9)
    if course.samples:
        rests = course.samples[-1].position - outcome.home_offset
        assert rests == pytest.approx(homes.rests, abs=1e-6)


@pytest.mark.parametrize(('name', 'axis'), REFUSED)
def test_what_cannot_be_converted_says_why(name, axis):
    why = REFUSED[name, axis]
    if not axis:
        with pytest.raises(Unconvertible, match=f'^{why[:3]}'.replace('$', r'\$')) as caught:
            converted(name)
        assert why in str(caught.value)
        return
    found = {one.name: one for one in converted(name).axes}[axis]
    assert why in found.refusal
    assert axis not in converted(name).parameters


@pytest.mark.parametrize('name', [name for name in EVERY_FILE if name.endswith('.ini')])
def test_every_homing_key_of_an_ini_is_taken_or_remarked(name):
    text = yaml_text(converted(name), name)
    for line in (FOREIGN / name).read_text().splitlines():
        key = line.partition('=')[0].strip()
        if key.startswith('HOME'):
            assert key in text or key in ('HOME_SEQUENCE',), key


@pytest.mark.parametrize('kind', KINDS)
def test_the_mapping_names_parameters_that_exist(kind):
    for row in KINDS[kind].TABLE:
        for name in filter(None, row.ours.split(', ')):
            known = {*DEFINITIONS, 'home_sequence'}
            ending = name.removeprefix('...')
            found = (
                name in known
                or any(one.endswith(ending) for one in known)
                or name == 'invert_..._ls_polarity'
            )
            assert found, name


# -- one key at a time ----------------------------------------------------------------------------

INI = """
[EMC]
[KINS]
KINEMATICS = trivkins coordinates=XYYZ
[TRAJ]
LINEAR_UNITS = mm
[JOINT_0]
MIN_LIMIT = 0
MAX_LIMIT = 100
MAX_ACCELERATION = 100
"""


def ini(*lines):
    """Return the settings of an ini with some lines, and its axis."""
    axis = convert(INI + '\n'.join(lines)).axes[0]
    return axis.values, axis


@pytest.mark.parametrize(
    ('search', 'latch', 'index', 'home_type', 'direction'),
    [
        (10, 1, 'NO', 'HSHS', 'Positive'),
        (-10, -1, 'NO', 'HSHS', 'Negative'),
        (10, -1, 'NO', 'HSReverse', 'Positive'),
        (-10, 1, 'NO', 'HSReverse', 'Negative'),
        (10, 1, 'YES', 'HSZPulse', 'Positive'),
        (-10, 1, 'YES', 'HSReverseZPulse', 'Negative'),
        (0, 1, 'YES', 'ZPulse', 'Positive'),
        (0, -1, 'YES', 'ZPulse', 'Negative'),
        (0, 0, 'NO', 'CurrentPos', None),
    ],
)
def test_the_signs_of_linuxcnc_choose_the_type(search, latch, index, home_type, direction):
    values, axis = ini(
        f'HOME_SEARCH_VEL = {search}', f'HOME_LATCH_VEL = {latch}', f'HOME_USE_INDEX = {index}'
    )
    assert axis.refusal == ''
    assert values['home_type'] == home_type
    assert values.get('home_direction') == direction


@pytest.mark.parametrize(
    ('lines', 'why'),
    [
        (['HOME_SEARCH_VEL = 5'], 'without HOME_LATCH_VEL: LinuxCNC refuses it too'),
        (['HOME_LATCH_VEL = 5'], 'LinuxCNC refuses it too'),
        (['HOME_ABSOLUTE_ENCODER = 2'], 'an absolute encoder is not homed'),
        (['MAX_LIMIT = 0'], 'no travel follows from it (--travel gives one)'),
    ],
)
def test_what_linuxcnc_has_and_the_node_has_not(lines, why):
    assert why in ini(*lines)[1].refusal


def test_joints_of_one_letter_have_names_of_their_own():
    text = INI + ''.join(f'\n[JOINT_{n}]\nMIN_LIMIT = 0\nMAX_LIMIT = 9' for n in (1, 2, 3))
    assert [axis.name for axis in convert(text).axes] == ['x', 'y', 'y2', 'z']


def test_a_key_of_linuxcnc_that_is_not_known_is_remarked():
    assert any('HOME_TWICE = 1' in remark for remark in ini('HOME_TWICE = 1')[1].remarks)


def test_the_final_move_of_linuxcnc():
    lines = ['HOME_SEARCH_VEL = -5', 'HOME_LATCH_VEL = -1', 'HOME = 3', 'HOME_OFFSET = -2']
    values, _ = ini(*lines, 'HOME_FINAL_VEL = 7', 'VOLATILE_HOME = 1')
    assert values['home_shift_distance'] == pytest.approx(-0.005)
    assert values['home_position'] == pytest.approx(0.003)
    assert values['home_shift_velocity'] == pytest.approx(0.007)
    assert values['clear_home_done_on_servo_off'] is True


def test_an_angular_joint_is_in_rad():
    values, _ = ini('TYPE = ANGULAR', 'HOME_SEARCH_VEL = 180', 'HOME_LATCH_VEL = 90')
    assert values['unit'] == 'rad'
    assert values['homing_velocity_fast'] == pytest.approx(3.14159265)


DUMP = '$22={}\n$23=0\n$24=60\n$25=600\n$27=2\n$100=1\n$110=300\n$120=100\n$130=50\n'


def test_the_cycles_and_passes_of_grblhal():
    text = DUMP.format(1) + '$101=1\n$131=50\n$43=3\n$44=2\n$45=1\n$5=1\n'
    made = convert(text)
    assert made.home_sequence == ['y', 'x']
    assert made.parameters['x']['repeat'] == 3
    assert made.parameters['x']['invert_positive_ls_polarity'] is True
    assert made.parameters['x']['homing_velocity_fast'] == pytest.approx(0.005)  # $110
    assert any('max rate' in remark for remark in made.axes[0].remarks)


def test_a_dump_of_grbl_without_a_needed_setting():
    with pytest.raises(Unconvertible, match=r'the dump has no \$24, \$27'):
        convert('$22=1\n$23=0\n$25=600\n$130=50\n')


PRINTER = '[printer]\nkinematics: {}\nmax_accel: 1000\n[stepper_x]\nendstop_pin: P1\n'


@pytest.mark.parametrize(
    ('lines', 'values'),
    [
        ('position_endstop: 0\nposition_max: 100', {'home_direction': 'Negative'}),
        ('position_endstop: 100\nposition_max: 100', {'home_direction': 'Positive'}),
        (
            'position_endstop: 50\nposition_max: 100\nhoming_positive_dir: true',
            {'home_direction': 'Positive', 'home_type': 'HSHS'},
        ),
        (
            'position_endstop: 0\nposition_max: 100\nhoming_retract_dist: 0',
            {'home_type': 'HS', 'homing_velocity_fast': 0.005, 'homing_velocity_slow': 0.0025},
        ),
    ],
)
def test_klipper_keys(lines, values):
    made = convert(PRINTER.format('cartesian') + lines).parameters['x']
    assert {name: made[name] for name in values} == values


@pytest.mark.parametrize(
    ('kinematics', 'lines', 'why'),
    [
        ('cartesian', 'position_endstop: 50\nposition_max: 100', 'set homing_positive_dir'),
        ('corexy', 'position_endstop: 0\nposition_max: 100', 'kinematics: corexy'),
        ('cartesian', 'position_endstop: 0', 'no position_max'),
        ('cartesian', 'position_max: 100', 'no position_endstop'),
    ],
)
def test_what_klipper_has_and_the_node_has_not(kinematics, lines, why):
    assert why in convert(PRINTER.format(kinematics) + lines).axes[0].refusal


BUS = """
master: {node_id: 1, driver: "ros2_canopen::MasterDriver"}
nodes:
  lift:
    node_id: 2
    driver: "ros2_canopen::Cia402Driver"
    homing_timeout_seconds: 30
    sdo:
      - {index: 0x6098, sub_index: 0, value: %s}
      - {index: 0x607C, sub_index: 0, value: 250}
      - {index: 0x6099, sub_index: 1, value: 100}
"""


def test_a_drive_without_a_travel():
    assert '--travel gives one' in convert(BUS % 23).axes[0].refusal
    values = convert(BUS % 23, travel=0.4).parameters['lift']
    assert values['home_type'] == 23
    assert values['home_position'] == pytest.approx(0.25)
    assert values['timeout'] == 30.0
    assert values['switches'][0] == 'home_switch'


@pytest.mark.parametrize(
    ('method', 'why'), [(0, 'the drive does not home'), (-3, "drive maker's own"), (31, '31')]
)
def test_a_method_that_has_no_equal(method, why):
    assert why in convert(BUS % method, travel=0.4).axes[0].refusal


# -- the kind of file, and the command ------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'named'),
    [
        ('/**:\n  ros__parameters:\n    axes: [x]\n', 'a parameter file of this node'),
        ('#define X_HOME_DIR -1\n', "Marlin's Configuration.h"),
        ('M574 X1 S1\n', "RepRapFirmware's G-code"),
        ('axes:\n  x:\n    homing:\n', "FluidNC's YAML"),
        ('loadrt hm2_eth\n', 'a HAL file of LinuxCNC'),
        ('<robot name="r"/>\n', 'a URDF or another XML file'),
        ('hello\n', 'the kind of file is not known'),
        ('a: ' + 5000 * '[' + 5000 * ']', 'the kind of file is not known'),
        ('', 'the kind of file is not known'),
    ],
)
def test_a_kind_that_is_not_known_is_named(text, named):
    with pytest.raises(Unconvertible) as caught:
        convert(text)
    assert named in str(caught.value)
    assert 'known are LinuxCNC ini, grbl $$ dump, Klipper printer.cfg' in str(caught.value)


def test_the_command_writes_a_file_that_the_node_reads(tmp_path, capsys):
    made = tmp_path / 'axes.yaml'
    assert main(['convert', str(FOREIGN / 'knee_mill_index.ini'), '-o', str(made)]) == 0
    assert 'axis a is not converted: MIN_LIMIT' in capsys.readouterr().out
    assert set(yaml_file.load(made).axes) == {'x', 'y', 'z'}
    assert main(['convert', str(FOREIGN / 'laser.grbl')]) == 0
    assert capsys.readouterr().out.startswith('# Converted from laser.grbl (grbl $$ dump)')


@pytest.mark.parametrize(
    ('arguments', 'status', 'said'),
    [
        (['mill_not_homing.grbl'], 1, '$22=0'),
        (['robot_drives.yml'], 1, 'joint_2: 0x6098 is not set'),
        (['nothing.ini'], 2, 'No such file'),
    ],
)
def test_a_file_that_the_command_cannot_use(arguments, status, said, capsys):
    assert main(['convert', str(FOREIGN / arguments[0]), *arguments[1:]]) == status
    assert said in capsys.readouterr().err


def test_a_setting_tells_its_origin():
    assert Setting('travel', 0.1, 'MAX_LIMIT = 100.0') in [
        setting._replace(value=0.1, origin='MAX_LIMIT = 100.0')
        for setting in ini('HOME_SEARCH_VEL = 5', 'HOME_LATCH_VEL = 5')[1].settings
    ]
