"""Planning problems, this package's planner beside OMPL with Coal and RoboPlan, and a judge."""
