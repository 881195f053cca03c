"""The ROS 2 nodes: all that imports rclpy is here, and nothing outside of this folder does."""
