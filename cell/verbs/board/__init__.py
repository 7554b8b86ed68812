"""`cell board`: the board to print, at scale."""

from cell.verbs.board.sheet import draw_board, how_to_check

__all__ = ["draw_board", "how_to_check"]
