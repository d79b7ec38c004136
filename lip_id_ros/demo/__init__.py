"""Demonstrations on a simulated arm, with ROS and without."""
