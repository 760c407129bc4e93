# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node itself, and names that no axis may have. SI units."""

import re
from collections.abc import Mapping

from ..procedures.states import TextEnum
from .definition import Definition, table

AXIS_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')

#: Where the files of the memory are: `$ROS_HOME` (default `~/.ros`), the full name of the node.
MEMORY_FOLDER = '$ROS_HOME/homing/<node>'
#: Where the records of the runs are, of all nodes.
RECORD_FOLDER = '$ROS_HOME/homing/records'

#: Names under the node's own that an axis must not take.
RESERVED = frozenset(
    {
        'home',
        'jog',
        'cancel',
        'change_state',
        'coordinated',
        'get_available_states',
        'get_available_transitions',
        'get_state',
        'get_transition_graph',
        'layout',
        'lifecycle',
        'locks',
        'transition_event',
        'setpoints',
        'position_commands',
        'position_joints',
        'dof_commands',
        'joint_states',
        'emergency_stop',
        'axes',
        'update_rate',
        'cycle_timeout',
        'ready_timeout',
        'setpoint_interface',
        'home_sequence',
        'marker_frame',
        'markers',
        'memory',
        'qos_overrides',
        'record',
        'record_failures',
        'record_runs',
        'use_sim_time',
        'start_type_description_service',
        'describe_parameters',
        'get_parameter_types',
        'get_parameters',
        'get_type_description',
        'list_parameters',
        'parameters',
        'serialized',
        'setpoint_horizon',
        'setpoint_lead',
        'setpoint_stamp',
        'set_parameters',
        'set_parameters_atomically',
    }
)


class SetpointInterface(TextEnum):
    """How setpoints leave the node."""

    trajectory = 'trajectory'
    position = 'position'
    dof = 'dof'


class SetpointStamp(TextEnum):
    """What the stamp of a trajectory is: the time of its first point, or 0."""

    due = 'due'
    zero = 'zero'


NODE_DEFINITIONS: Mapping[str, Definition] = table(
    Definition('the names of the axes', list, name='axes'),
    Definition(
        'rate of the control cycle', float, 'Hz', 1.0, 2000.0, name='update_rate', default=250.0
    ),
    Definition(
        'a cycle that is later than this ends the run',
        float,
        's',
        0.001,
        60.0,
        name='cycle_timeout',
        default=0.2,
    ),
    Definition(
        'how long a request waits for what is missing: publishers, levels, feedback, a controller',
        float,
        's',
        0.0,
        600.0,
        name='ready_timeout',
        default=5.0,
    ),
    Definition(
        'how setpoints are published: ~/setpoints, ~/position_commands or ~/dof_commands',
        SetpointInterface,
        name='setpoint_interface',
        default=SetpointInterface.trajectory,
    ),
    Definition(
        'the joints of ~/position_commands and ~/dof_commands, in the order of the controller '
        '(empty: those of the axes)',
        list,
        name='position_joints',
        default=[],
    ),
    Definition(
        'how far ahead ~/setpoints tells the plan, before a stop to rest',
        float,
        's',
        0.0,
        1.0,
        name='setpoint_horizon',
        default=0.02,
    ),
    Definition(
        'how long a change of the plan is told before it acts: a period of the controller and the '
        'delay of a message at its worst',
        float,
        's',
        0.0,
        0.1,
        name='setpoint_lead',
        default=0.008,
    ),
    Definition(
        'when ~/setpoints starts: at its stamp (due), or when it arrives (zero)',
        SetpointStamp,
        name='setpoint_stamp',
        default=SetpointStamp.due,
    ),
    Definition(
        'read feedback and write trajectories as bytes (false: as messages, slower)',
        bool,
        name='serialized',
        default=True,
    ),
    Definition(
        'folder of what is kept of the runs (empty: nothing is kept)',
        str,
        name='memory',
        default=MEMORY_FOLDER,
    ),
    Definition(
        'folder of the records of the runs (empty: runs are not recorded)',
        str,
        name='record',
        default=RECORD_FOLDER,
    ),
    Definition(
        'records of runs that ended well, of which the newest are kept',
        int,
        '',
        0,
        1_000_000,
        name='record_runs',
        default=50,
    ),
    Definition(
        'records of runs that failed, of which the newest are kept',
        int,
        '',
        0,
        1_000_000,
        name='record_failures',
        default=200,
    ),
    Definition(
        'the frame of the markers of each axis, which runs along its x (linear) or turns about '
        'its z (rotary); <axis> and <joint> stand for the names',
        str,
        name='marker_frame',
        default='<joint>',
    ),
    Definition(
        'file of where things are along the axes (YAML), with which it is rehearsed how long they '
        'take that have not homed yet (empty: it is not rehearsed)',
        str,
        name='layout',
        default='',
    ),
    Definition(
        'be a managed node: requests are accepted once it is configured and activated',
        bool,
        name='lifecycle',
        default=False,
    ),
    Definition(
        'home only while a coordinator is heard on ~/locks',
        bool,
        name='coordinated',
        default=False,
    ),
    Definition(
        'groups of axes that home together, in order, e.g. ["z", "x, y"] '
        '(empty: one after another)',
        list,
        name='home_sequence',
        default=[],
    ),
)

#: The parameters that every ROS node has.
COMMON_DEFINITIONS: Mapping[str, Definition] = table(
    Definition('follow /clock', bool, name='use_sim_time', default=False),
    Definition(
        'serve the descriptions of types',
        bool,
        name='start_type_description_service',
        default=True,
    ),
)
