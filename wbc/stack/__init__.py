"""From declared items to compiled code (floor 4)."""
