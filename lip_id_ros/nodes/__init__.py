"""ROS 2 nodes: convert, call, convert, publish; what they do is in rooms that need no ROS."""
