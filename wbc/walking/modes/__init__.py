"""What a walk can do besides a plan: be driven, move one hand, refuse moves, begin with nothing held."""
