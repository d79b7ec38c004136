"""
The process of a job: reads recordings and writes a model, a data set, a payload or a motion.

Started by `Jobs`; its standard input is a JSON request, what it prints are JSON lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import json
import os
import signal
import sys
from typing import Any, TextIO

from lip_id_ros.acquisition.job import receive, SAVING
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError, LipIdError, one_line
from lip_id_ros.evaluation import data_remarks, matched
from lip_id_ros.excitation.rounds import MotionRequest, next_motion
from lip_id_ros.export.payload import inertias, require_links, to_yaml
from lip_id_ros.files import write_whole
from lip_id_ros.loading.data_settings import selected_config
from lip_id_ros.loading.examined import findings_of, load_dataset
from lip_id_ros.loading.load import noted
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.preprocessing.pipeline import at_most
from lip_id_ros.progress import Progress
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import AUTO, Config, override
from lip_id_ros.workflow.fit import find_payload, learn

NICENESS = 5
"""How much a job gives way to the processes that move the robot."""

SHOWN = ('source', 'samples', 'dropped')
"""What of a source's provenance is worth a look in ~/status."""


def main(requests: TextIO, output: TextIO) -> int:
    """
    Do what the request of `Jobs` asks, as one JSON text; return the exit status.

    `output` gets one JSON object per line: `progress` (stage, done, total), then `result` or
    `error`.
    """
    request = json.load(requests)
    before = signal.getsignal(signal.SIGTERM)
    try:
        _emit(output, {'result': _work(request, _reporter(output))})
    except (LipIdError, OSError) as error:
        _emit(output, {'error': one_line(error)})
        return 1
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0


def _work(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    if request['kind'] == 'motion':
        return _motion(request, progress)
    config = override(Config(), request['settings'], 'the parameters')
    sections = receive(request['recording'])
    share = 1.0 - request.get('holdout', 0.0)
    prepared = training_set(sections, request['bags'], config, progress, share)
    result: dict[str, Any] = {
        'n_samples': prepared.dataset.n_samples,
        'sources': _sources(prepared.dataset),
        'left_out': list(prepared.left_out),
        'thinned': prepared.n_thinned,
    }
    if request['kind'] == 'dataset':
        cautions = data_remarks(prepared.dataset.provenance)
        saved = _save(prepared.dataset.save, request['path'], progress)
        return {**result, **saved, 'cautions': cautions}
    if request['kind'] == 'payload':
        return {**result, **_payload(prepared.dataset, request, progress)}
    return {**result, **_fit(prepared.dataset, request, config, progress)}


def _fit(
    data: Dataset, request: dict[str, Any], config: Config, progress: Progress
) -> dict[str, Any]:
    learned = learn(data, config, request['holdout'], progress)
    saved = _save(learned.model.save, request['path'], progress)
    return {
        **saved,
        'summary': learned.model.summary,
        'cautions': learned.cautions,
        'holdout': learned.evaluation and learned.evaluation.to_json(),
    }


def _payload(data: Dataset, request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    model = InverseDynamicsModel.load(request['model'])
    require_links(model, request['model'])
    flange = request['flange']
    found = find_payload(model, matched(data, model), flange)
    shown = found.payload
    text = to_yaml(shown, [each.get('source', '') for each in _sources(data)], flange)
    figures = {
        'mass': shown.mass,
        'mass_std': shown.mass_std,
        'centre_of_mass': shown.centre.tolist(),
        'centre_of_mass_std': shown.centre_std.tolist(),
        'inertia_about_centre_of_mass': inertias(shown),
    }
    if request['payload_model']:
        _save(found.model.save, request['payload_model'], progress)
    saved = _save(lambda place: write_whole(place, text.encode()), request['path'], progress)
    return {**saved, 'cautions': found.cautions, 'payload': figures}


def _motion(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    asked = MotionRequest(**request['settings'])
    motion, found = next_motion(asked, progress)
    if asked.report_path:
        from lip_id_ros.excitation.report import write_motion_report

        write_motion_report(asked.report_path, found, progress)
    return {**_save(found.save, request['path'], progress), 'motion': motion.to_json()}


def _save(save: Callable[[str], None], path: str, progress: Progress) -> dict[str, Any]:
    """
    Save a result and return where it is.

    From here on the job cannot be cancelled: what is saved is reported as well.
    """
    progress(SAVING, 0, 1)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    save(path)
    return {'path': path}


def _sources(data: Dataset) -> list[dict[str, Any]]:
    sources = data.provenance.get('sources', [data.provenance])
    return [{key: each[key] for key in SHOWN if key in each} for each in sources]


def _reporter(output: TextIO) -> Progress:
    def report(stage: str, done: int, total: int) -> None:
        _emit(output, {'progress': [stage, done, total]})

    return report


def _emit(output: TextIO, content: dict[str, Any]) -> None:
    output.write(json.dumps(content) + '\n')
    output.flush()


@dataclass(frozen=True)
class TrainingSet:
    """
    A data set, and the part of the live recording that is not in it.

    `left_out`: why sections could not be used, one sentence for all of the same. `n_thinned`:
    samples that the bound `max_samples` left out.
    """

    dataset: Dataset
    left_out: Sequence[str] = ()
    n_thinned: int = 0


def training_set(
    sections: Sequence[JointSamples],
    bags: Sequence[str],
    config: Config,
    progress: Progress,
    training_share: float = 1.0,
) -> TrainingSet:
    """
    Join a live recording and bags, by sections `recording` and `preprocessing` of the settings.

    A section that is too short is left out, unless nothing else is there. Bags must have the
    joints of the live recording where the settings name none. `training_share`: first share that
    `cutoff_hz: -1` may look at; where there is a live recording, it looks at that alone.
    LipIdError if a bag cannot be used, or nothing is left.
    """
    report: dict[str, Any] = {}
    if sections and config.preprocessing.cutoff_hz == AUTO:
        config, report = selected_config(sections, config, training_share, progress)
    live, left_out = _of_sections(sections, config)
    live = [noted(data, report) for data in live]
    if not live and not bags:
        raise DataError(left_out[0])
    whole = replace(config, preprocessing=replace(config.preprocessing, max_samples=0))
    parts = live
    if bags:
        of_bags = _with_joints(whole, live)
        parts = [*live, load_dataset(bags, of_bags, progress, training_share)]
    joined = concatenate(parts)
    dataset = at_most(joined, config.preprocessing)
    return TrainingSet(dataset, left_out, joined.n_samples - dataset.n_samples)


def _of_sections(
    sections: Sequence[JointSamples], config: Config
) -> tuple[list[Dataset], list[str]]:
    usable, left_out = [], Counter[str]()
    settings = replace(config.preprocessing, max_samples=0)
    assess = findings_of(config.recording)
    for samples in sections:
        try:
            data = preprocess(samples, settings, config.recording)
        except DataError as error:
            left_out[str(error)] += 1
        else:
            usable.append(noted(data, assess(samples)))
    return usable, [
        why if n == 1 else f'{n} parts of the recording: {why}' for why, n in left_out.items()
    ]


def _with_joints(config: Config, live: Sequence[Dataset]) -> Config:
    if config.recording.joints or not live:
        return config
    return replace(config, recording=replace(config.recording, joints=live[0].joint_names))


if __name__ == '__main__':
    os.nice(NICENESS)
    sys.exit(main(sys.stdin, sys.stdout))
