"""Stacks and controllers as users know them (floor 10): the only package that knows all ways from one to the other."""

from wbc.api.controller import Controller
from wbc.api.stack import Stack

__all__ = ["Controller", "Stack"]
