"""Cells and plans that come with the program: links into configs/."""
