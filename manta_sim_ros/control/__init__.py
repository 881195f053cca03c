"""Path following, free of ROS: guidance, loops with gains from the linear model, and the closed loop."""
