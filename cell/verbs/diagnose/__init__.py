"""`cell diagnose`: compare the simulated cell with a recording, and say what differs.

Public: `diagnose_into`.
"""

from cell.verbs.diagnose.verb import diagnose_into

__all__ = ["diagnose_into"]
