"""What a walk can do besides a plan: drive as told, move one hand, refuse moves, begin with nothing held."""
