"""Plots and one self-contained web page."""

from lip_id_ros.evaluation.report.band import Band, band
from lip_id_ros.evaluation.report.writing import Labels, write_report

__all__ = ['Band', 'Labels', 'band', 'write_report']
