"""Designs the poses of a plan for a cell."""

from cell.verbs.plan.planner import design_plan
from cell.verbs.plan.requirements import Requirements
from cell.verbs.plan.size import PlanSize

__all__ = ["PlanSize", "Requirements", "design_plan"]
