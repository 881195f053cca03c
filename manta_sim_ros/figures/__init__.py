"""The paper's numerical examples, Section 5: measured, drawn and animated, without ROS."""
