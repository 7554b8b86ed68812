"""Finds camera and board of a cell that is only roughly known, by a few small, slow moves."""

from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty
from cell.verbs.bootstrap.verb import Bootstrap, Bootstrapped

__all__ = ["Bootstrap", "Bootstrapped", "LayoutUncertainty"]
