"""Settings: one table per group, for YAML files, the command line, ROS parameters and docs."""

from lip_id_ros.settings.sections import flat_rows, flatten, override, sections
from lip_id_ros.settings.settings import build, Row, rows, setting, Settings
from lip_id_ros.settings.tables import (
    Config,
    FitSettings,
    PreprocessingSettings,
    RecordingSettings,
)
from lip_id_ros.settings.yaml_file import example_yaml, read_config

__all__ = [
    'Config',
    'FitSettings',
    'PreprocessingSettings',
    'RecordingSettings',
    'Row',
    'Settings',
    'build',
    'example_yaml',
    'flat_rows',
    'flatten',
    'override',
    'read_config',
    'rows',
    'sections',
    'setting',
]
