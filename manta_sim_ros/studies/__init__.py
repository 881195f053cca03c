"""Studies of the robot without middleware: batch simulations, and what is computed from them and from recordings."""
