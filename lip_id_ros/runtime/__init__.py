"""
What the nodes do, without ROS: checks, limits, jobs.

Nothing here imports rclpy or a message package; messages come in as any object with the fields
of the message, so that every rule can be tested without a graph.

"""
