"""Plots and one self-contained web page."""

from lip_id_ros.evaluation.report.figures import Band, band, Labels, write_report

__all__ = ['Band', 'Labels', 'band', 'write_report']
