"""Cells and plans that come with the program: links into configs/, copies where it is installed."""

from pathlib import Path

DRY_RUN_PLAN = (Path(__file__).parent / "irb140-eosens.plan.yaml").resolve()
"""What `cell run --dry-run` takes where no plan is named.

Resolved, since a cell file must stand in its plan's own folder: in a checkout that is configs/.
"""
