"""ROS 2 nodes: they convert messages and publish; rooms without ROS do the work."""
