"""MCAP, read with its library in a process of its own: messages of ROS 1, ROS 2 and JSON."""
