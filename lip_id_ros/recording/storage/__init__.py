"""Storage files of bags, read as far as they can be: MCAP, sqlite3, ROS 1."""
