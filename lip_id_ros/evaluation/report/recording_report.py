"""A folder with the plots of a recording and one page that holds them and the findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
from typing import Any

from lip_id_ros.evaluation.health_text import health_table, lines
from lip_id_ros.evaluation.report import recording_plots, style
from lip_id_ros.evaluation.report.folder import picture, write_folder
from lip_id_ros.evaluation.report.page import page, Picture
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.health import Evidence
from lip_id_ros.progress import Progress, silent

SIGNALS = (
    'Position, velocity and effort as they were recorded (effort scaled where settings say so).'
)
COVERAGE = (
    'Position and velocity of each joint, low-passed. A model knows only what lies near these '
    'lines.'
)


def write_recording_report(
    folder: str | os.PathLike[str],
    source: str,
    recordings: Sequence[tuple[Evidence, Mapping[str, Any]]],
    progress: Progress = silent,
) -> Path:
    """
    Write PNG plots and index.html, which embeds them and needs no network.

    Parameters
    ----------
    folder : path
        Made where it does not exist; files of an older report are replaced. Where there are
        several recordings, each gets a folder 1, 2, ... in it.
    source : str
        Where they come from.
    recordings : sequence of (Evidence, mapping)
        With at least one sample, and their health.
    progress : Progress
        Told after every recording.

    Returns
    -------
    Path
        The page of the first recording.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    pages = []
    for number, (evidence, health) in enumerate(recordings, start=1):
        target = Path(folder) / str(number) if len(recordings) > 1 else Path(folder)
        pages.append(_report(target, source, evidence, health))
        progress('plot', number, len(recordings))
    return pages[0]


def _report(target: Path, source: str, evidence: Evidence, health: Mapping[str, Any]) -> Path:
    pictures = _pictures(evidence)
    findings = health['findings']
    samples = evidence.samples
    facts = (
        ('recording', source),
        ('topic', samples.topic or '-'),
        ('samples', str(samples.n_samples)),
        ('duration', f'{samples.t[-1] - samples.t[0]:.4g} s'),
    )
    text = page(
        'Health of a recording',
        lines(finding for finding in findings if finding['severity'] != 'note'),
        [health_table(health['joints'])],
        lines(finding for finding in findings if finding['severity'] == 'note'),
        pictures,
        Table('Recording', (), facts),
    )
    return write_folder(target, text, pictures)


def _pictures(evidence: Evidence) -> list[Picture]:
    with style.styled():
        signals = recording_plots.signals(evidence)
        pictures = [picture('signals', 'What was recorded', SIGNALS, signals)]
        if evidence.motion.stretches:
            drawn = recording_plots.coverage(evidence)
            pictures.append(picture('coverage', 'Where the joints have been', COVERAGE, drawn))
    return pictures
