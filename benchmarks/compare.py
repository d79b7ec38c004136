"""The paper's comparisons of models: one page and one JSON file for each experiment."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from benchmarks._experiments import EXPERIMENTS, Form
from benchmarks.baselines import Method, method
from benchmarks.comparison import Case, compare, Store
from benchmarks.comparison.report import write_comparison
from benchmarks.comparison.run import Make, remarks, tables
from lip_id_ros.cli.output import progress_display
from lip_id_ros.evaluation.tables import show, show_lines


def main(arguments: list[str]) -> int:
    """Run one experiment, what is finished already left out."""
    options = _options(arguments)
    short, full = EXPERIMENTS[options.experiment]
    form = full if options.full else short
    models = options.models or form.models
    words = options.experiment.replace('_', ' ').capitalize()
    name = f'{words}, {"in full" if options.full else "short form"}'
    folder: Path = options.output or Path(f'comparison_{options.experiment}')
    # cells of networks that were trained for longer are other cells
    store = Store(folder / f'cells_{form.delan_steps}')
    with progress_display() as progress:
        cases = list(form.cases())
        results = compare(cases, models, form.settings, store, progress, _maker(form))
        facts = [('experiment', name), ('data', 'simulated Panda, benchmarks/_experiments.py')]
        page = write_comparison(folder, name, cases, results, store, facts, progress)
    console = Console(width=140)
    for table in tables(results):
        show(table, console)
    show_lines([*remarks(results), f'Written: {page}'], console)
    return 0


def _maker(form: Form) -> Make:
    def make(model: str, case: Case) -> Method:
        if model != 'delan':
            return method(model, case.urdf)
        from benchmarks.baselines.delan import Delan

        return Delan(form.delan_steps)

    return make


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks compare', description=__doc__)
    parser.add_argument('experiment', choices=sorted(EXPERIMENTS))
    parser.add_argument('--full', action='store_true', help='as in the paper: hours to days')
    parser.add_argument('--models', nargs='+', help='only these')
    parser.add_argument(
        '-o', '--output', type=Path, help='folder (default: comparison_EXPERIMENT)'
    )
    return parser.parse_args(arguments)
