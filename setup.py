# SPDX-License-Identifier: Apache-2.0
"""Builds homing_node, with colcon as an ament_python package or with pip alone."""

import os
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

package = 'homing_node'
executables = {
    'homing_node': 'homing_node.start:homing_node',
    'homing_coordinator': 'homing_node.start:homing_coordinator',
    'homed_axes': 'homing_node.start:homed_axes',
    'simulated_axes': 'homing_node.start:simulated_axes',
    'homing': 'homing_node.start:homing',
}
data_files = [
    ('share/ament_index/resource_index/packages', [f'resource/{package}']),
    (f'share/{package}', ['package.xml']),
    (f'share/{package}/launch', sorted(glob('launch/*.py'))),
    *(
        (f'share/{package}/{folder}', sorted(map(str, files)))
        for folder in ('config', 'config/drivers', 'config/drivers/ros2_control')
        if (files := [one for one in Path(folder).iterdir() if one.is_file()])
    ),
]

if os.environ.get('COLCON'):
    # rosdep installs what package.xml names; setup.cfg puts the executables in lib/.
    requirements = ['setuptools']
else:
    # pip puts the executables in bin/; `ros2 run` looks for them in lib/.
    data_files.append((f'lib/{package}', [f'scripts/ros2run/{name}' for name in executables]))
    interfaces = Path(__file__).resolve().parent / 'interfaces' / 'homing_interfaces'
    requirements = [
        'ros-jazzy-rclpy[fastrtps]',
        'ros-jazzy-common-interfaces',
        f'homing_interfaces @ {interfaces.as_uri()}',
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        'numpy',
        'PyYAML',
        'rich',
        'ruckig',
    ]

setup(
    name=package,
    version='0.1.0',
    packages=find_packages(include=[package, f'{package}.*']),
    data_files=data_files,
    python_requires='>=3.10',
    install_requires=requirements,
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,
    maintainer='The homing_node developers',
    maintainer_email='homing_node@users.noreply.github.com',
    description='Homes machine axes: finds the reference position of each axis',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [f'{name} = {target}' for name, target in executables.items()],
    },
)
