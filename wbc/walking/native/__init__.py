"""The compiled inner loops of the planner, and numpy arrays as they want them."""
