"""Designs the poses of a plan for a cell."""

from cell.planning.planner import design_plan
from cell.planning.size import PlanSize
from cell.planning.wish import Wish

__all__ = ["PlanSize", "Wish", "design_plan"]
