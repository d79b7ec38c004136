"""Computed torque: the efforts of a plan, and PD feedback."""
