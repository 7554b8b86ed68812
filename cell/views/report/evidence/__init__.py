"""The picture that convinces for each kind of effect: a registry from effect to drawing."""

from __future__ import annotations

from cell.views.report.evidence.registry import EVIDENCE, Picture, picture_of, register
from cell.views.report.evidence.remedy import remedy_of

__all__ = ["EVIDENCE", "Picture", "picture_of", "register", "remedy_of"]
