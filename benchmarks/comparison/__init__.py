"""Several methods on the same data: fit each, evaluate each on the same unseen motions, report."""

from benchmarks.comparison.cell import Case, Cell, Score, thinned
from benchmarks.comparison.run import compare, Results, Store

__all__ = ['Case', 'Cell', 'Results', 'Score', 'Store', 'compare', 'thinned']
