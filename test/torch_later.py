"""torch for tests: loaded, with its 500 MB, where a test first uses it, and by one worker."""

from __future__ import annotations

from collections.abc import Callable
import importlib
import importlib.util
from typing import Any

import pytest

NEEDS_TORCH = [
    pytest.mark.skipif(
        importlib.util.find_spec('torch') is None, reason='the reference differentiates with torch'
    ),
    pytest.mark.xdist_group('torch'),
]
"""The `pytestmark` of a file whose tests all need torch."""


def needs_torch(test: Callable[..., None]) -> Callable[..., None]:
    """Mark one test of a file."""
    for mark in NEEDS_TORCH:
        test = mark(test)
    return test


class Later:
    """A module that needs torch; `LazyLoader` would load it where scipy looks."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith('_') or 'pytest' in name:  # pytest looks at what a test module holds
            raise AttributeError(name)
        return getattr(importlib.import_module(self._name), name)


Tensor = Any
torch: Any = Later('torch')
