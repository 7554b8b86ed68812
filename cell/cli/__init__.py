"""The command line: one file per verb, heavy libraries loaded by the verbs that need them."""

from cell.cli.app import main

__all__ = ["main"]
