"""A second checker."""
def second_check(log, robot, structure):
    return []
