"""The progress line of studies: how many runs there are."""

from __future__ import annotations


class RunsBar:
    """A line on standard error with how many runs there are."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import Progress as Line

        self._line = Line(console=Console(stderr=True), transient=True, refresh_per_second=4)
        self._task = self._line.add_task("runs", total=None)
        self._line.start()

    def update(self, done: int, count: int | None = None) -> None:
        """Show how far it is; `count` is how many there will be, where that is known."""
        self._line.update(self._task, total=count, completed=done, description=f"{done} runs")

    def stop(self) -> None:
        """Remove the line."""
        self._line.stop()
