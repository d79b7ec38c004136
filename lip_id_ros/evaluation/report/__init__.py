"""Plots and one self-contained web page."""

from lip_id_ros.evaluation.report.evaluation_report import Band, band, Labels, write_report

__all__ = ['Band', 'Labels', 'band', 'write_report']
