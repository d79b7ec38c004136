"""The generated plugin of inverse_dynamics_solver, compiled against declarations of its own."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
import shutil
import subprocess
import xml.etree.ElementTree as ET

from export.arms import arm_of, COUPLED, model_of, random_arm
from export.readers import states_of
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.cli import main
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.export.solver_package import (
    LONGEST_NAME,
    package_name,
    save,
    solver_package,
)

# What the plugin uses of ROS, whose headers the tests' Jazzy lacks.
DECLARATIONS = {
    'rclcpp/node_interfaces/node_parameters_interface.hpp': """
        #pragma once
        #include <memory>
        namespace rclcpp::node_interfaces {
        struct NodeParametersInterface {
          using ConstSharedPtr = std::shared_ptr<const NodeParametersInterface>;
        };
        }
        """,
    'inverse_dynamics_solver/inverse_dynamics_solver.hpp': """
        #pragma once
        #include <string>
        #include <tuple>
        #include <Eigen/Core>
        #include <rclcpp/node_interfaces/node_parameters_interface.hpp>
        namespace inverse_dynamics_solver {
        class InverseDynamicsSolver {
        public:
          using V = Eigen::VectorXd;
          virtual ~InverseDynamicsSolver() = default;
          virtual void initialize(
            rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr = nullptr,
            const std::string & = "", const std::string & = "") = 0;
          virtual std::tuple<Eigen::MatrixXd, V, V> getDynamicParameters(
            const V & q, const V & dq) const
          { return {getInertiaMatrix(q), getCoriolisVector(q, dq), getGravityVector(q)}; }
          virtual Eigen::MatrixXd getInertiaMatrix(const V &) const = 0;
          virtual V getCoriolisVector(const V &, const V &) const = 0;
          virtual V getGravityVector(const V &) const = 0;
          virtual V getFrictionVector(const V &) const = 0;
          virtual V getTorques(const V & q, const V & dq, const V & ddq) const
          { return getInertiaMatrix(q) * ddq + getCoriolisVector(q, dq) + getGravityVector(q); }
        };
        }
        """,
    # a factory takes the place of the class loader, and a function that asks for everything
    'pluginlib/class_list_macros.hpp': """
        #pragma once
        #include <exception>
        #include <memory>
        #define PLUGINLIB_EXPORT_CLASS(Class, Base) \\
          static std::unique_ptr<Base> made() \\
          { std::unique_ptr<Base> s(new Class); s->initialize(); return s; } \\
          extern "C" void ask(int n, const double * q, const double * dq, const double * ddq, \\
            double * M, double * c, double * g, double * f, double * tau) { \\
            using V = Eigen::VectorXd; \\
            auto in = [n](const double * x) { return V(Eigen::Map<const V>(x, n)); }; \\
            auto out = [n](double * x, const V & v) { Eigen::Map<V>(x, n) = v; }; \\
            const auto s = made(); \\
            const auto [inertia, coriolis, gravity] = s->getDynamicParameters(in(q), in(dq)); \\
            Eigen::Map<Eigen::MatrixXd>(M, n, n) = inertia; \\
            out(c, coriolis); out(g, gravity); \\
            out(f, s->getFrictionVector(in(dq))); \\
            out(tau, s->getTorques(in(q), in(dq), in(ddq))); } \\
          extern "C" bool refuses(int n) { \\
            try { made()->getGravityVector(Eigen::VectorXd::Zero(n)); } \\
            catch (const std::invalid_argument &) { return true; } \\
            return false; }
        """,
}
STRICT = ('-std=c++17', '-O1', '-Wall', '-Wextra', '-pedantic', '-Werror', '-shared', '-fPIC')


def eigen() -> Path:
    """Folder of Eigen's headers: of the system, or those that pinocchio's wheel depends on."""
    found = [Path('/usr/include/eigen3')]
    pinocchio = pytest.importorskip('pinocchio')
    for parent in Path(pinocchio.__file__).parents:
        found += [parent / 'include' / 'eigen3', parent / 'cmeel.prefix' / 'include' / 'eigen3']
    return next((each for each in found if each.is_dir()), None) or pytest.skip('needs Eigen')


def declared(folder: Path) -> Path:
    for name, text in DECLARATIONS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def written(arm: ArmDescription, folder: Path) -> str:
    save(solver_package(arm, to_c_header(arm)), folder)
    return package_name(arm.name)


def files_of(folder: Path) -> list[Path]:
    return [path for path in folder.rglob('*') if path.is_file()]


class Plugin:
    def __init__(self, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.refuses.restype = ctypes.c_bool

    def ask(self, q: Array, dq: Array, ddq: Array) -> list[Array]:
        """Return M, C dq, g, friction and all torques at a state."""
        n = len(q)
        out = [np.empty((n, n)), *(np.empty(n) for _ in range(4))]
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (q, dq, ddq, *out)]
        self._library.ask(n, *pointers)
        return out

    def refuses(self, n: int) -> bool:
        return bool(self._library.refuses(n))


@pytest.mark.skipif(shutil.which('g++') is None, reason='needs g++')
@pytest.mark.parametrize('kinds', ['RPRRRRR', 'RR', COUPLED])
def test_the_plugin_gives_what_the_model_does(kinds: str, tmp_path: Path) -> None:
    arm = arm_of(kinds)
    package = written(arm, tmp_path / 'package')
    library = tmp_path / 'plugin.so'
    paths: list[str | Path] = [
        '-I',
        tmp_path / 'package' / 'include',
        '-I',
        declared(tmp_path / 'ros'),
    ]
    source = tmp_path / 'package' / 'src' / f'{package}.cpp'
    command = ['g++', *STRICT, *paths, '-isystem', eigen(), '-o', library, source]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    plugin, model = Plugin(library), model_of(arm)
    states = states_of(arm, 20)
    predicted = model.predict(*states)
    scale = np.abs(predicted.tau).max()
    links, zeros = predicted.tau - predicted.friction, np.zeros_like(predicted.tau)
    # a controller gets friction of steady motion: softened as in recordings, an arm may stick
    whole = links + arm.friction.torque(states[0], states[1], zeros, load=links)
    for row in range(states.shape[1]):
        q, dq, ddq = (np.ascontiguousarray(each[row]) for each in states)
        M, coriolis, gravity, friction, tau = plugin.ask(q, dq, ddq)
        parts = (
            (tau, whole),
            (coriolis, predicted.coriolis),
            (gravity, predicted.gravity),
        )
        for found, expected in (*parts, (M @ ddq, predicted.inertial)):
            np.testing.assert_allclose(found, expected[row], atol=1e-9 * scale)
        zero = np.zeros((1, arm.n_joints))
        unloaded = arm.friction.torque(zero, dq[None], zero, load=zero)
        np.testing.assert_allclose(friction, unloaded[0], atol=1e-9 * scale)
    assert plugin.refuses(arm.n_joints + 1)
    assert not plugin.refuses(arm.n_joints)


def test_names_of_the_package_are_those_of_its_files(tmp_path: Path) -> None:
    arm = random_arm('RPR')
    package = written(arm, tmp_path)
    assert ET.parse(tmp_path / 'package.xml').findtext('name') == package
    described = ET.parse(tmp_path / f'{package}.xml').getroot()
    assert described.attrib['path'] == package
    (plugin,) = described
    assert plugin.attrib['type'] == f'{package}::InverseDynamicsSolver'
    source = (tmp_path / 'src' / f'{package}.cpp').read_text()
    assert f'{package}::InverseDynamicsSolver, inverse_dynamics_solver' in source
    assert package_name('My__Arm_') == 'my_arm_inverse_dynamics_solver'
    assert '%{' not in ''.join(path.read_text() for path in files_of(tmp_path))


FOUND = """
add_library({name} INTERFACE)
target_include_directories({name} INTERFACE {include})
set({name}_TARGETS {name})
set({name}_FOUND TRUE)
"""
PLUGINS = """
function(pluginlib_export_plugin_description_file base file)
  install(FILES ${file} DESTINATION share/${PROJECT_NAME})
endfunction()
"""
AMENT = """
function(ament_target_dependencies target)
  foreach(name ${ARGN})
    target_link_libraries(${target} PUBLIC ${${name}_TARGETS})
  endforeach()
endfunction()
function(ament_package)
  install(FILES package.xml DESTINATION share/${PROJECT_NAME})
endfunction()
"""


@pytest.mark.skipif(shutil.which('cmake') is None, reason='needs cmake')
@pytest.mark.slow
def test_cmake_builds_and_installs_it(tmp_path: Path) -> None:
    """With packages that stand for those of ROS; colcon builds it where these are installed."""
    arm, ros = random_arm('RR'), declared(tmp_path / 'ros')
    package = written(arm, tmp_path / 'package')
    folders = {
        'Eigen3': FOUND.format(name='Eigen3', include=eigen()),
        'inverse_dynamics_solver': FOUND.format(name='inverse_dynamics_solver', include=ros),
        'pluginlib': FOUND.format(name='pluginlib', include=ros) + PLUGINS,
        'ament_cmake': AMENT,
    }
    given = []
    for name, text in folders.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / f'{name}Config.cmake').write_text(text)
        given.append(f'-D{name}_DIR={tmp_path / name}')
    build, installed = tmp_path / 'build', tmp_path / 'install'
    prefix = f'-DCMAKE_INSTALL_PREFIX={installed}'
    environment = {**os.environ, 'CXX': 'g++'}
    commands: tuple[list[str | Path], ...] = (
        ['cmake', '-S', tmp_path / 'package', '-B', build, prefix, *given],
        ['cmake', '--build', build],
        ['cmake', '--install', build],
    )
    for command in commands:
        ran = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert ran.returncode == 0, ran.stdout + ran.stderr
    assert not Plugin(installed / 'lib' / f'lib{package}.so').refuses(2)
    assert (installed / 'include' / package / f'{arm.name}_dynamics.h').is_file()
    assert (installed / 'share' / package / f'{package}.xml').is_file()


def test_the_verb_writes_a_package_and_replaces_no_other_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model_of(random_arm('RR')).save(tmp_path / 'arm.npz')
    command = ['export', str(tmp_path / 'arm.npz'), '--solver-package', str(tmp_path / 'solver')]
    for _ in range(2):  # its own is replaced
        assert main(command) == 0
        assert f'Written: {tmp_path / "solver"}' in ''.join(capsys.readouterr().out.split('\n'))
    assert (
        'arm_torque'
        in (
            tmp_path / 'solver' / 'include' / 'arm_inverse_dynamics_solver' / 'arm_dynamics.h'
        ).read_text()
    )
    other = tmp_path / 'solver' / 'src' / 'by_hand_inverse_dynamics_solver.cpp'
    other.write_text('// no file of this program')
    assert main([*command, '--name', 'Other_Arm']) == 0
    files = {str(path.relative_to(tmp_path / 'solver')) for path in files_of(tmp_path / 'solver')}
    package = 'other_arm_inverse_dynamics_solver'
    assert files == {
        *('CMakeLists.txt', 'package.xml', f'{package}.xml', f'src/{package}.cpp'),
        *(f'include/{package}/Other_Arm_dynamics.h', f'src/{other.name}'),
    }
    (tmp_path / 'solver' / 'package.xml').write_text('<package/>')
    assert main(command) == 1
    assert 'is not a package of a solver; name another folder' in ' '.join(
        capsys.readouterr().err.split()
    )
    assert main([*command, '--force']) == 0


def test_a_name_too_long_for_files_leaves_the_package_before_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model_of(random_arm('RR')).save(tmp_path / 'arm.npz')
    command = ['export', str(tmp_path / 'arm.npz'), '--solver-package', str(tmp_path / 'solver')]
    assert main([*command, '--name', 'a' * LONGEST_NAME]) == 0
    before = set(files_of(tmp_path / 'solver'))
    targets = ['--urdf', str(tmp_path / 'arm.urdf')]
    assert main([*command, *targets, '--name', 'a' * (LONGEST_NAME + 1)]) == 1
    said = ' '.join(capsys.readouterr().err.split())
    assert 'must have 200 letters at most in a package, not 201; give a shorter --name.' in said
    assert set(files_of(tmp_path / 'solver')) == before
    assert not (tmp_path / 'arm.urdf').exists()
