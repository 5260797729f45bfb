"""Bags of ROS 1, read with rosbags in a process of its own."""
