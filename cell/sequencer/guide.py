"""What decides on the way which view comes next, where no plan could know it before."""

from __future__ import annotations

from abc import ABC, abstractmethod

from cell.sequencer.guard import Guard
from cell.sequencer.watcher import Watcher
from cell.storage.files.plan_file import View


class Guide(Watcher, ABC):
    """Watches a run, and is asked for another view each time the plan has none left."""

    @property
    @abstractmethod
    def guard(self) -> Guard:
        """Checks every move of the run, in the place of the plan's own."""

    @abstractmethod
    def next_view(self) -> View | None:
        """The view to take next, None to end the run; from the worker's thread.

        Every frame before it has been judged. Whatever is raised ends the run, the arm stopped
        first.
        """
