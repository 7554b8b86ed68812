"""Finds camera and board of a cell that is only roughly known, by a few small, slow moves."""

from cell.bootstrap.told import Told
from cell.bootstrap.verb import Bootstrap, Bootstrapped

__all__ = ["Bootstrap", "Bootstrapped", "Told"]
