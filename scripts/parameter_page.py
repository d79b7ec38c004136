"""
Write docs/reference/parameters.md from the tables that declare the nodes' parameters.

``python scripts/parameter_page.py > docs/reference/parameters.md`` writes it; a test holds it.
"""

from __future__ import annotations

from collections.abc import Mapping
import json
import sys

from lip_id_ros.acquisition.settings import train_parameters
from lip_id_ros.adaptation.live import AdaptSettings
from lip_id_ros.excitation.settings import RoundSettings
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.settings import parameters_of, Row
from lip_id_ros.settings.settings import AT_ONCE

COMMAND = 'python scripts/parameter_page.py > docs/reference/parameters.md'

INTRODUCTION = f"""\
# Parameters of the nodes

The nodes declare and check their parameters by the settings tables in `lip_id_ros/acquisition`,
`excitation`, `feedforward`, `monitoring` and `adaptation`, and those of a fit.
`{COMMAND}` writes this page from them.

- Start from [train.yaml](../../config/train.yaml) and [serve.yaml](../../config/serve.yaml), which
  fit any arm. [panda.yaml](../../config/panda.yaml) has both nodes in one file:
  `ros2 run lip_id_ros train --ros-args --params-file panda.yaml`.
- A node refuses a value of a wrong type or out of its range, and says why. At the start it then
  ends with exit status 1.
- A node refuses unknown parameters too, so that a misspelt limit is not ignored.
- A whole number is accepted where a number with a point is expected.
- An empty list is `[]`, in a file and on the command line.
- *In use* says when a running node takes a new value. A value that is read at the start cannot be
  changed later.
- `use_sim_time` works as in every node. A message without a stamp gets the time of `/clock`. The
  status is published even if that clock stands still.
"""

TYPES = {
    'bool': 'bool',
    'int': 'integer',
    'float': 'double',
    'str': 'string',
    'list of str': 'string array',
    'list of float': 'double array',
}

HEADER = """\
| Parameter | Type | Default | Allowed | Unit | In use | Description |
|---|---|---|---|---|---|---|"""


def page() -> str:
    """Return the page as Markdown."""
    nodes = node_parameters()
    return '\n'.join([INTRODUCTION, *(_node(name, table) for name, table in nodes.items())])


def node_parameters() -> dict[str, dict[str, Row]]:
    """Return the parameters of every node by its name."""
    others = {
        'excite': RoundSettings,
        'serve': ServeSettings,
        'monitor': MonitorSettings,
        'adapt': AdaptSettings,
    }
    return {
        'train': train_parameters(),
        **{name: parameters_of(table) for name, table in others.items()},
    }


def _node(name: str, table: Mapping[str, Row]) -> str:
    lines = [_line(parameter, row) for parameter, row in table.items()]
    return '\n'.join([f'## `{name}`', '', HEADER, *lines, ''])


def _line(name: str, row: Row) -> str:
    cells = (
        f'`{name}`',
        TYPES[row.kind],
        f'`{json.dumps(row.default)}`',
        row.range,
        row.unit,
        row.applies or AT_ONCE,
        row.description,
    )
    return f'| {" | ".join(cells)} |'


def main() -> None:
    """Print the page."""
    sys.stdout.write(page())


if __name__ == '__main__':
    main()
