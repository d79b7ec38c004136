"""The ROS node of a simulated Panda."""
