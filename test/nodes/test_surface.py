"""docs/reference/surface.md says what the nodes have while they run; parameters too."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('control_msgs', reason='needs control_msgs')

from rcl_interfaces.msg import ParameterDescriptor
from ros_domain import free_domain

from lip_id_ros.nodes import parameters
from lip_id_ros.settings.settings import AT_START
from scripts import surface_page
from scripts.parameter_page import node_parameters

if TYPE_CHECKING:
    from scripts.surface_page import Surface

pytestmark = pytest.mark.ros

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'reference' / 'surface.md'
OF_ROS = {'use_sim_time', 'start_type_description_service'}


@pytest.fixture(scope='module')
def surfaces() -> dict[str, Surface]:
    with free_domain() as domain:
        return surface_page.surfaces(domain)


def test_the_page_is_what_the_nodes_have(surfaces: dict[str, Surface]) -> None:
    page = surface_page.page(surfaces)
    assert PAGE.read_text(encoding='utf-8') == page, f'run {surface_page.COMMAND}'


def test_the_parameters_are_those_of_the_tables(surfaces: dict[str, Surface]) -> None:
    def described(each: ParameterDescriptor) -> tuple[object, ...]:
        return each.description, each.integer_range, each.floating_point_range

    tables = node_parameters()
    assert surfaces.keys() == tables.keys()
    for node, surface in surfaces.items():
        assert surface.parameters.keys() - OF_ROS == tables[node].keys()
        for name, row in tables[node].items():
            found, declared = surface.parameters[name], parameters.descriptor(row)
            assert found.type == parameters.TYPES[row.kind].value, name
            assert described(found) == described(declared), name
            assert found.read_only == (row.applies == AT_START), name
