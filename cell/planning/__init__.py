"""Designs the poses of a plan for a cell."""

from cell.planning.planner import PlanSize, design_plan

__all__ = ["PlanSize", "design_plan"]
