"""Messages of robots: ``definitions`` reads the text that describes a message, ``decode`` its bytes of ROS 1 or ROS 2,
``rows`` gathers the numbers of each topic to columns. No code is made of what a file holds.
"""
