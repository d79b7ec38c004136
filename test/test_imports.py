"""The direction of imports: who may use whom, and which foreign package is used where."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = 'lip_id_ros'
SOURCES = Path(__file__).resolve().parents[1] / PACKAGE

# The parts in the order in which the data goes through them, and what each may import besides
# itself and BASE.
BASE = {
    'arrays',
    'checked_file',
    'csv_table',
    'errors',
    'files',
    'joint_types',
    'numba_jit',
    'progress',
}
PARTS = {
    'arrays': set(),
    'errors': set(),
    'checked_file': set(),
    'csv_table': set(),
    'files': set(),
    'joint_types': set(),
    'numba_jit': set(),
    '__main__': set(),
    'progress': set(),
    'linear_algebra': set(),
    'settings': set(),
    'dataset': set(),
    'recording': {'settings'},
    'preprocessing': {'settings', 'dataset', 'recording'},
    'health': {'settings', 'dataset', 'recording', 'preprocessing', 'identification'},
    'rigid_body': set(),
    'description': {'rigid_body'},
    'friction': set(),
    'kernels': {'linear_algebra', 'rigid_body'},
    'model': {'friction', 'kernels', 'rigid_body'},
    'gp': {'settings', 'dataset', 'kernels', 'linear_algebra'},
    'identification': {
        *('dataset', 'description', 'friction', 'gp', 'linear_algebra', 'model', 'rigid_body'),
        'settings',
    },
    # its selection of a cut-off predicts torques of links
    'loading': {
        *('dataset', 'health', 'identification', 'preprocessing', 'recording', 'rigid_body'),
        'settings',
    },
    'export': {'description', 'friction', 'identification', 'model', 'rigid_body'},
    'evaluation': {
        *(
            'dataset',
            'description',
            'friction',
            'health',
            'identification',
            'linear_algebra',
            'model',
            'recording',
        ),
        *('rigid_body', 'settings'),
    },
    'excitation': {
        *('dataset', 'description', 'evaluation', 'export', 'friction', 'model', 'recording'),
        *('rigid_body', 'settings', 'signals'),
    },
    'fleet': {
        *('dataset', 'evaluation', 'export', 'friction', 'identification', 'linear_algebra'),
        *('loading', 'model', 'preprocessing', 'recording', 'rigid_body', 'settings'),
    },
    'workflow': {
        *('dataset', 'evaluation', 'export', 'fleet', 'identification', 'loading', 'model'),
        *('preprocessing', 'settings'),
    },
    'adaptation': {
        *('dataset', 'evaluation', 'export', 'friction', 'identification', 'model'),
        *('recording', 'rigid_body', 'settings', 'signals'),
    },
    'signals': {'model', 'recording'},
    'monitoring': {'adaptation', 'model', 'recording', 'settings', 'signals'},
    'feedforward': {'adaptation', 'friction', 'model', 'recording', 'settings', 'signals'},
    'simulation': {'dataset', 'evaluation', 'recording', 'rigid_body'},
}
# These may import every part above; nobody imports them, but for the exceptions named here.
INNER = set(PARTS)
PARTS |= {
    '__init__': INNER,  # the Python face
    'acquisition': INNER - {'feedforward', 'monitoring', 'simulation'},
    'nodes': INNER - {'simulation'} | {'acquisition'},
    'cli': INNER,
    'demo': {'dataset', 'nodes', 'recording', 'settings', 'signals', 'simulation'},
}

ROS = ('nodes', 'demo')
FOREIGN = {
    'numpy': ('',),
    'scipy': ('',),
    'numba': ('numba_jit', 'kernels'),  # prange in loops over all threads
    'threadpoolctl': ('gp/placement_search', 'identification', 'fleet'),
    'fsspec': (
        'fleet/sources',
        'fleet/stored_files',
    ),
    'rosbags': ('recording',),
    'lz4': ('recording/storage/contents',),
    # zstd: the standard library has it from 3.14 as compression
    'backports': ('recording/storage/contents',),
    'compression': ('recording/storage/contents',),
    'yaml': (
        'settings',
        'recording/bags',
        'feedforward/plan_files',
        'fleet/sources',
        'fleet/stored_files',
    ),
    'coal': ('excitation/shapes',),
    'pinocchio': ('simulation', 'excitation/shapes'),
    'mujoco': ('export/mjcf',),
    'example_robot_data': ('simulation',),
    'matplotlib': ('adaptation/report', 'evaluation/report', 'excitation/report'),
    'rich': ('evaluation/tables', 'cli'),
    'argcomplete': ('cli/main',),  # imported where the shell asks
    'rclpy': ROS,
    'action_msgs': ROS,
    'ament_index_python': ROS,
    'launch': ROS,
    'launch_ros': ROS,
    'builtin_interfaces': ROS,
    'control_msgs': ROS,
    'diagnostic_msgs': ROS,
    'geometry_msgs': ROS,
    'lifecycle_msgs': ROS,
    'pal_statistics_msgs': ROS,
    'rcl_interfaces': ROS,
    'sensor_msgs': ROS,
    'std_msgs': ROS,
    'std_srvs': ROS,
    'trajectory_msgs': ROS,
    'unique_identifier_msgs': ROS,
}

MODULES = sorted(SOURCES.rglob('*.py'))


@cache
def imported(path: Path) -> tuple[str, ...]:
    """Full names of everything that a module imports, wherever in it."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import; write the full name'
            # from lip_id_ros import dataset: the part is among the names
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def place(path: Path) -> str:
    """Where a module lies in the package: 'kernels/gram', 'errors'."""
    return path.relative_to(SOURCES).with_suffix('').as_posix().removesuffix('/__init__')


@pytest.mark.parametrize('path', MODULES, ids=place)
def test_imports_keep_their_direction(path: Path) -> None:
    part = place(path).split('/')[0]
    assert part in PARTS, f'{part} is new: give it a row in the table of parts'
    allowed = PARTS[part] | (BASE if part not in BASE else {'arrays', 'errors', 'files'}) | {part}
    parts = {name.split('.')[1] for name in imported(path) if name.startswith(f'{PACKAGE}.')}
    assert parts <= allowed


@pytest.mark.parametrize('path', MODULES, ids=place)
def test_foreign_packages_stay_in_their_places(path: Path) -> None:
    for name in imported(path):
        package = name.split('.')[0]
        if package != PACKAGE and package not in sys.stdlib_module_names:
            assert package in FOREIGN, f'{package} is new: give it a row in the table'
            assert any(
                f'{place(path)}/'.startswith(f'{home}/' if home else '')
                for home in FOREIGN[package]
            ), f'{package} belongs in {FOREIGN[package]}'


def test_modules_import_each_other_in_no_circle() -> None:
    """Imports inside functions and for types alone count too."""
    names = {f'{PACKAGE}.{place(path)}'.replace('/', '.'): path for path in MODULES}
    imports = {
        module: {
            name if name in names else name.rpartition('.')[0]
            for name in imported(path)
            if name.startswith(PACKAGE)
        }
        for module, path in names.items()
    }
    list(TopologicalSorter(imports).static_order())  # raises CycleError


STARTING = [path for path in MODULES if 'sys.executable' in path.read_text(encoding='utf-8')]


@pytest.mark.parametrize('path', STARTING, ids=place)
def test_processes_import_nothing_from_the_working_folder(path: Path) -> None:
    """A yaml.py beside the recordings would be run."""
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.List) and node.elts:
            first, *others = map(ast.unparse, node.elts)
            assert first != 'sys.executable' or others[0] == "'-P'"


# A serving process on a robot's computer starts in a second and stays small; the command line
# works where there is no ROS.
LIGHT = {
    'lip_id_ros.model': ('torch', 'rclpy', 'matplotlib', 'pinocchio', 'rosbags'),
    'lip_id_ros.gp': ('torch', 'rclpy', 'matplotlib', 'pinocchio', 'rosbags'),
    'lip_id_ros.cli': ('torch', 'rclpy', 'pinocchio', 'matplotlib'),
    'lip_id_ros.acquisition.recorder': ('torch', 'numba', 'matplotlib', 'pinocchio'),
    'lip_id_ros.acquisition.settings': ('torch', 'numba', 'matplotlib', 'pinocchio'),
}


@pytest.mark.slow
@pytest.mark.parametrize('module', sorted(LIGHT))
def test_import_stays_light(module: str) -> None:
    program = f'import {module}, sys; print(*sorted(sys.modules))'
    ran = subprocess.run(
        [sys.executable, '-c', program],
        capture_output=True,
        text=True,
        cwd=SOURCES.parent,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert not set(LIGHT[module]) & set(ran.stdout.split())
