"""What else a new friction term needs, as CONTRIBUTING lists it: no term is forgotten there."""

from __future__ import annotations

from pathlib import Path

from export.arms import EXTRA
from friction.test_terms import EVERY
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.conservative_terms import LeverSpring
from lip_id_ros.friction.terms import FrictionTerm
from lip_id_ros.identification.friction_candidates import (
    candidates,
    lever_candidate,
    plain_candidates,
)
from lip_id_ros.identification.sample_selection import remembering

MATHS = Path(__file__).resolve().parents[2] / 'docs' / 'explanation' / 'maths.md'
PLAIN = ('viscous', 'Coulomb', 'offset')


@pytest.mark.parametrize('term', EVERY, ids=lambda term: term.name)
def test_has_a_row_in_the_maths(term: FrictionTerm) -> None:
    text = MATHS.read_text(encoding='utf-8').partition('## 12.')[2].partition('## 13.')[0]
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('|')]
    assert term.name in [name.strip() for row in rows for name in row.split(',')]


def test_the_election_is_offered_every_term() -> None:
    q = np.linspace(-4.0, 4.0, 50)[:, None] * np.ones(2)
    dataset = Dataset.from_arrays(q, q, q, q)
    widths = np.array([0.1, 0.1])
    offered = [*plain_candidates(widths), *candidates(widths, remembering(dataset))]
    offered.append(lever_candidate(0, LeverSpring(0.5, 0.0), []))  # after a search
    names = {part.term.name for each in offered for part in each.terms}
    assert names == {term.name for term in EVERY}


def test_exports_are_tested_with_every_kind_of_term() -> None:
    tested = {type(term) for term in EXTRA} | {type(t) for t in EVERY if t.name in PLAIN}
    assert tested == {type(term) for term in EVERY}
