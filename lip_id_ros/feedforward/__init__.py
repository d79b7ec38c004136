"""The node `serve` without ROS: check references, predict torques, shape and watch them."""
