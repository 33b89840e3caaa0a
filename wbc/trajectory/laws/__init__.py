"""Laws of motion: a path and its timing, what limits it keeps, as a file and as a plot."""
