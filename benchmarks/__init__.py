"""Measurements of speed and accuracy, kept so that anyone can repeat them."""
