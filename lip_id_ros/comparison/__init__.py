"""Several methods on the same data: fit each, judge each on the same unseen motions, report."""

from lip_id_ros.comparison.case import Case, thinned
from lip_id_ros.comparison.cell import Cell, Score
from lip_id_ros.comparison.run import compare
from lip_id_ros.comparison.store import Store

__all__ = ['Case', 'Cell', 'Score', 'Store', 'compare', 'thinned']
