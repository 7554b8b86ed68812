"""Two calibrations of one camera: where they differ, and whether by more than chance."""

from cell.verbs.compare.comparison import Comparison, Difference, Row, compare
from cell.verbs.compare.side import Side, side_of

__all__ = ["Comparison", "Difference", "Row", "Side", "compare", "side_of"]
