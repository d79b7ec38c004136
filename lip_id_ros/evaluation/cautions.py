"""What a user should know before relying on a fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def of_fit(summary: Mapping[str, Any]) -> list[str]:
    """
    Say what was unusual about a fit.

    Parameters
    ----------
    summary : mapping
        Of the model.

    Returns
    -------
    list of str
        Sentences, none where all went well.

    """
    texts = [note] if (note := summary.get('device_note')) else []
    if at_bounds := summary['at_bounds']:
        some = ', '.join(at_bounds[:4])
        texts.append(
            f'{len(at_bounds)} hyperparameters ran to a bound ({some}): the fit may interpolate '
            'the recording; judge it on unseen data before you trust it.'
        )
    if share := summary.get('inertia_not_pd_percent'):
        texts.append(
            f'The inertia matrix is not positive definite at {share:.3g} % of the training '
            'samples: accelerations were too small, or a light joint too well hidden, to tell it. '
            'Torques are not concerned; do not invert M(q).'
        )
    return texts
