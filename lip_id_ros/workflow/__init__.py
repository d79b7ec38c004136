"""What every entrance does with recordings: load, hold out, fit, judge, caution."""
