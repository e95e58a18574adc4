"""ROS 2, over DDS and without ROS: robots as bodies, singly or all of a domain, and simulated Scouts as ROS 2 robots.

`mapping` and `messages` say what topics mean, and `link` brings it.
"""
