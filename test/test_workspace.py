# SPDX-License-Identifier: Apache-2.0
"""Both packages in a ROS workspace, and README's words to install what only PyPI has."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from catkin_pkg.packages import find_package_paths, find_packages

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / 'scripts' / 'workspace.py'
BOTH = ['homing_interfaces', 'homing_node']
#: The Python of the distribution; on Debian 12 and Ubuntu 24.04 it is managed by apt.
SYSTEM = Path('/usr/bin/python3')


def lay_out(*arguments, script=SCRIPT, cwd=None):
    return subprocess.run(
        [sys.executable, script, *arguments], capture_output=True, text=True, cwd=cwd, check=False
    )


@pytest.fixture
def clone(tmp_path):
    """Put the repository into the `src/` of a workspace, as `git clone` does."""
    folder = tmp_path / 'src' / 'homing_node'
    ignored = shutil.ignore_patterns('.git', '.venv*', '.*_cache', '__pycache__', '.hypothesis')
    shutil.copytree(ROOT, folder, ignore=ignored)
    return folder


# -- siblings -------------------------------------------------------------------------------------


def test_below_a_package_no_tool_looks(clone):
    """This is why there is a script."""
    assert find_package_paths(clone.parent) == ['homing_node']


def test_a_newcomer_who_clones_into_src_gets_both_packages(clone):
    done = lay_out('.', script='homing_node/scripts/workspace.py', cwd=clone.parent)
    assert done.returncode == 0, done.stderr
    assert sorted(find_package_paths(clone.parent)) == BOTH
    assert not clone.is_symlink()


def test_a_workspace_elsewhere_links_both(tmp_path):
    workspace = tmp_path / 'src'
    for _ in range(2):  # a second time changes nothing
        done = lay_out(workspace)
        assert done.returncode == 0, done.stderr
        assert sorted(find_package_paths(workspace)) == BOTH
    assert all((workspace / name).is_symlink() for name in BOTH)
    packages = find_packages(workspace)
    assert sorted(package.name for package in packages.values()) == BOTH
    assert len({package.version for package in packages.values()}) == 1


def test_a_release_has_copies_that_stand_alone(tmp_path):
    assert lay_out('--copy', tmp_path).returncode == 0
    assert sorted(find_package_paths(tmp_path)) == BOTH
    assert not any(path.is_symlink() for path in tmp_path.rglob('*'))
    assert not (tmp_path / 'homing_node' / 'interfaces').exists()
    for name in BOTH:
        assert (tmp_path / name / 'LICENSE').is_file()
        assert not list((tmp_path / name).glob('.venv*'))
    assert (tmp_path / 'homing_interfaces' / 'msg' / 'AxisState.msg').is_file()
    named = subprocess.run(
        [sys.executable, 'setup.py', '--name'],
        cwd=tmp_path / 'homing_node',
        env={**os.environ, 'COLCON': '1'},
        capture_output=True,
        text=True,
        check=True,
    )
    assert named.stdout.split()[-1] == 'homing_node'


def test_what_is_there_is_not_overwritten(tmp_path):
    (tmp_path / 'homing_interfaces').mkdir()
    for options in [], ['--copy']:
        done = lay_out(*options, tmp_path)
        assert done.returncode == 1
        assert f'{tmp_path}/homing_' in done.stderr and 'exists' in done.stderr
    assert list((tmp_path / 'homing_interfaces').iterdir()) == []


def test_make_workspace(tmp_path):
    for arguments, status in ([f'DIR={tmp_path}/src'], 0), ([], 2):
        done = subprocess.run(
            ['make', 'workspace', f'PYTHON={sys.executable}', *arguments],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == status, done.stderr
    assert sorted(find_package_paths(tmp_path / 'src')) == BOTH


def test_dependencies_name_no_package_that_is_something_else():
    """ROS's key `ruckig` is the C++ library; the Python module has no key."""
    packages = find_packages(ROOT)
    names = {str(d) for d in packages['.'].exec_depends + packages['.'].test_depends}
    assert 'ruckig' not in names
    assert {'rclpy', 'homing_interfaces', 'launch_ros', 'python3-numpy'} <= names


# -- what only PyPI has ---------------------------------------------------------------------------


def readme_lines(*beginnings):
    """Return the lines of README that begin so, in their order."""
    lines = (ROOT / 'README.md').read_text().splitlines()
    return [line for line in lines if line.startswith(beginnings)]


@pytest.fixture(scope='module')
def wheels(tmp_path_factory):
    """A folder with a small wheel in place of ruckig's: the tests need no network."""
    folder = tmp_path_factory.mktemp('wheels')
    with zipfile.ZipFile(folder / 'ruckig-0.0.1-py3-none-any.whl', 'w') as wheel:
        wheel.writestr('ruckig/__init__.py', '')
        info = 'ruckig-0.0.1.dist-info'
        wheel.writestr(f'{info}/METADATA', 'Metadata-Version: 2.1\nName: ruckig\nVersion: 0.0.1\n')
        wheel.writestr(
            f'{info}/WHEEL',
            'Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n',
        )
        wheel.writestr(f'{info}/RECORD', '')
    return folder


def shell(lines, folder, wheels, **environment):
    """Run lines as a user of the system's own Python; pip finds the small wheel only."""
    return subprocess.run(
        ['bash', '-e'],
        input='\n'.join(lines),
        cwd=folder,
        env={
            'PATH': '/usr/bin:/bin',
            'HOME': str(folder),
            'PIP_CONFIG_FILE': os.devnull,
            'PIP_NO_INDEX': '1',
            'PIP_FIND_LINKS': str(wheels),
            'PIP_DISABLE_PIP_VERSION_CHECK': '1',
            **environment,
        },
        capture_output=True,
        text=True,
        check=False,
    )


def system_python(*modules):
    """Skip the test where the system's Python cannot do what a ROS user's can."""
    code = f'import {",".join(modules)}'
    tried = SYSTEM.exists() and subprocess.run([SYSTEM, '-c', code], check=False).returncode == 0
    if not tried:
        pytest.skip(f'{SYSTEM} does not have {", ".join(modules)}')


def test_plain_pip_is_refused_by_an_externally_managed_python(tmp_path, wheels):
    system_python('pip')
    code = 'import sysconfig; print(sysconfig.get_path("stdlib"))'
    stdlib = subprocess.run([SYSTEM, '-c', code], capture_output=True, text=True, check=True)
    if not Path(stdlib.stdout.strip(), 'EXTERNALLY-MANAGED').exists():
        pytest.skip(f'{SYSTEM} is not externally managed')
    done = shell(['python3 -m pip install --dry-run ruckig'], tmp_path, wheels)
    assert done.returncode != 0
    assert 'externally-managed-environment' in done.stderr


@pytest.mark.long
def test_readme_environment_works_on_the_systems_python(tmp_path, wheels):
    system_python('pip', 'venv', 'ensurepip')
    lines = readme_lines('python3 -m venv', '. venv/', 'touch venv/', 'pip install ruckig')
    assert [line.split()[0] for line in lines] == ['python3', '.', 'touch', 'pip']
    check = 'import pip, ruckig, sys; print(ruckig.__file__, sys.prefix, sys.base_prefix)'
    done = shell([*lines, f"python3 -c '{check}'"], tmp_path, wheels)
    assert done.returncode == 0, done.stderr
    module, prefix, base = done.stdout.splitlines()[-1].split()
    assert module.startswith(f'{tmp_path}/venv/') and prefix == f'{tmp_path}/venv'
    assert base == '/usr'
    # ROS's own modules are packages of apt: the environment must see those.
    settings = (tmp_path / 'venv' / 'pyvenv.cfg').read_text()
    assert 'include-system-site-packages = true' in settings
    assert (tmp_path / 'venv' / 'COLCON_IGNORE').exists()


def test_readme_words_without_an_environment_are_accepted(tmp_path, wheels):
    system_python('pip')
    (line,) = readme_lines('pip install --break-system-packages')
    done = shell([f'python3 -m {line}'], tmp_path, wheels, PIP_DRY_RUN='1')
    assert done.returncode == 0, done.stderr
    assert 'Would install ruckig' in done.stdout
