"""Independent references: the paper's equations in NumPy, and the robot in Pinocchio and in MuJoCo."""
