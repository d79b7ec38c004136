"""ROS nodes of a simulated Panda, and their settings."""
