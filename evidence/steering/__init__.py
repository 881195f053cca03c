"""How each input of the fins moves the robot: `python -m evidence.steering` writes docs/controller.md."""
