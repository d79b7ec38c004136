"""The node `train` without ROS: record in sections, fit in processes."""
