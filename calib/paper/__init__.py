"""The paper's method: per-distance scale factors, then a fit that holds them (C. Ricolfe-Viala).

Each file is one step of the paper, with its equations named and its misprints corrected;
`docs/paper.md` says what the paper says, what is done here instead, and why.
"""
