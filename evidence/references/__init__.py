"""Independent references: the equations as printed in NumPy, and the robot in Pinocchio and in MuJoCo."""
