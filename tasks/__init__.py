"""Tasks and constraints: declarative objects, one idea a file (floor 3)."""

from wbc.tasks.base import Bounds, Constraint, Input, Item, Order, Row, Rows, Task, Values, registry

__all__ = ["Bounds", "Constraint", "Input", "Item", "Order", "Row", "Rows", "Task", "Values", "registry"]
