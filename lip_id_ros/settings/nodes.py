"""What the parameters of all nodes share: when a new value is used, and the executor."""

from __future__ import annotations

from lip_id_ros.settings.settings import Row, rows, Settings

EXECUTORS = ('events', 'single_threaded')

AT_START = 'at the start only'
AT_ONCE = 'at once'
WHILE_EMPTY = 'at once, while no samples are kept'
NEXT_JOB = 'at the next fit or data set'
ON_CONFIGURE = 'on configure; refused while configured'
ON_LOAD = 'on configure or reload'

EXECUTOR_HELP = (
    'How callbacks are run. events takes less CPU at high rates; single_threaded is used where '
    'this ROS has no events executor.'
)

PER_JOINT = 'One per joint, in the order of joints, or one for all.'


def parameters_of(table: type[Settings]) -> dict[str, Row]:
    """Return the parameters of one table by name."""
    return {row.name: row for row in rows(table)}
