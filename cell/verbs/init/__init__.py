"""`cell init`: a cell file for this bench from a few answers."""

from cell.verbs.init.answers import HOMES_DEG, Answers
from cell.verbs.init.cell_text import cell_of, write_cell

__all__ = ["HOMES_DEG", "Answers", "cell_of", "write_cell"]
