"""A ROS 2 simulator of a robotic manta ray with flexible pectoral fins."""
