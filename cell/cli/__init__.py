"""The command line: one file per verb, heavy libraries loaded late; imports verbs and below."""

from cell.cli.app import main

__all__ = ["main"]
