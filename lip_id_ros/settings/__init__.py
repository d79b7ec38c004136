"""Settings: one table per group, for YAML files, the command line, ROS parameters and docs."""

from lip_id_ros.settings.sections import (
    example_yaml,
    flat_rows,
    flatten,
    override,
    read_config,
    read_sections,
    sections,
)
from lip_id_ros.settings.settings import (
    build,
    description_setting,
    executor_setting,
    parameters_of,
    Row,
    rows,
    setting,
    Settings,
)
from lip_id_ros.settings.tables import (
    AUTO,
    Config,
    FitSettings,
    PreprocessingSettings,
    RecordingSettings,
)

__all__ = [
    'AUTO',
    'Config',
    'FitSettings',
    'PreprocessingSettings',
    'RecordingSettings',
    'Row',
    'Settings',
    'build',
    'description_setting',
    'example_yaml',
    'executor_setting',
    'flat_rows',
    'flatten',
    'override',
    'parameters_of',
    'read_config',
    'read_sections',
    'rows',
    'sections',
    'setting',
]
