"""The progress line of what is counted: runs of a study, pictures of a film."""

from __future__ import annotations


class CountBar:
    """A line on standard error with how many there are of what is counted."""

    def __init__(self, what: str) -> None:
        from rich.console import Console
        from rich.progress import Progress as Line

        self._what = what
        self._line = Line(console=Console(stderr=True), transient=True, refresh_per_second=4)
        self._task = self._line.add_task(what, total=None)
        self._line.start()

    def update(self, done: int, count: int | None = None) -> None:
        """Show how far it is; `count` is how many there will be, where that is known."""
        text = f"{done} {self._what}"
        self._line.update(self._task, total=count, completed=done, description=text)

    def stop(self) -> None:
        """Remove the line."""
        self._line.stop()
