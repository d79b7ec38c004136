"""ROS 2 nodes: convert, call, convert, publish. What they do is in `lip_id_ros.runtime`."""
