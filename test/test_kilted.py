# SPDX-License-Identifier: Apache-2.0
"""What the environment with ROS 2 Kilted gets is made from the files for Jazzy."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope='module')
def kilted():
    spec = importlib.util.spec_from_file_location('kilted', ROOT / 'scripts' / 'kilted.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_pins_of_ros_are_replaced_and_the_others_stay(kilted, tmp_path):
    kilted.write(tmp_path)
    for name in kilted.REQUIREMENTS:
        before = (ROOT / name).read_text().splitlines()
        after = (tmp_path / name).read_text().splitlines()
        for old, new in zip(before, after, strict=True):
            assert new == old or (old.startswith('ros-jazzy-') and new.startswith('ros-kilted-'))
        assert 'jazzy' not in ''.join(after)


def test_the_interfaces_are_copied_with_their_build_list(kilted, tmp_path):
    for _ in range(2):  # an older copy is replaced
        kilted.write(tmp_path)
    copy = tmp_path / 'homing_interfaces'
    project = (copy / 'pyproject.toml').read_text()
    assert 'jazzy' not in project
    assert '"ros-kilted-rclpy[fastrtps]==9.1.2"' in project
    assert '"ros-kilted-ament-cmake-ros-core==' in project
    for file in kilted.INTERFACES.rglob('*'):
        if file.suffix in ('.msg', '.action', '.txt', '.xml'):
            assert (copy / file.relative_to(kilted.INTERFACES)).read_text() == file.read_text()


def test_a_package_without_a_version_is_a_fault(kilted):
    with pytest.raises(KeyError, match='tf2'):
        kilted.for_kilted('ros-jazzy-tf2==1.0.0')
