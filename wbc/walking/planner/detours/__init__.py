"""Detours: where the body can go when it cannot follow its path as it is."""

from wbc.walking.planner.detours.cells import ALONG, WIDE, CellSpacing
from wbc.walking.planner.detours.route import BodyRoute, find_route, find_routes

__all__ = ["ALONG", "WIDE", "BodyRoute", "CellSpacing", "find_route", "find_routes"]
