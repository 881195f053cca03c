"""A simulator of a robotic manta ray with flexible pectoral fins: a Python library and ROS 2 nodes."""

__version__ = '0.2.0'
