"""Models and Jacobians of robots in exact numbers, and the same in floating-point numbers to compare with."""
