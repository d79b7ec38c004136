"""Plots and one self-contained web page."""

from lip_id_ros.evaluation.report.evaluation_report import Labels, write_report
from lip_id_ros.evaluation.report.figures import Band, band

__all__ = ['Band', 'Labels', 'band', 'write_report']
