"""Laws of bounded jerk: from state to state, along a path, through poses, and from tick to tick."""
