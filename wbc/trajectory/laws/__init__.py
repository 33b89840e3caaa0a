"""Laws of motion: a path and its timing, what limits it satisfies, as a file and as a plot."""
