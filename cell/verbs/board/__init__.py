"""`cell board`: the board to print, at scale."""

from cell.verbs.board.sheet import SUFFIXES, draw_board, words_about

__all__ = ["SUFFIXES", "draw_board", "words_about"]
