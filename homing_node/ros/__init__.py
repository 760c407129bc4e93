"""The node: everything that knows ROS."""
