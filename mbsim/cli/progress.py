"""The progress line of `mbsim run`: what is compiled, then simulated time, step, time left."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING

from mbsim.cli.messages import echo, printable

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Display:
    """A line on standard error that begins with what is first shown and leaves no trace.

    A run that ends before that never imports rich.
    """

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._compiling = False

    def __enter__(self) -> Display:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def update(self, t: float, h: float, end_time: float) -> None:
        """Show where the run is."""
        bar, task = self._shown()
        if self._compiling:
            self._compiling = False
            bar.reset(task)
        bar.update(task, total=end_time, completed=t, now=f"t = {t:.6g}", step=f"h = {h:.3g}")

    def compiling(self, name: str) -> None:
        """Show the function that is compiled next, and how many there are as far as is known."""
        from mbsim.core import jit

        bar, task = self._shown()
        self._compiling = True
        known = jit.expected > jit.compiled
        now = f"compiling {jit.compiled}" + (f" of {jit.expected}" if known else "")
        total = jit.expected if known else None
        bar.update(task, total=total, completed=jit.compiled - 1, now=now, step=name)

    def _shown(self) -> tuple[Progress, TaskID]:
        """Return the line, begun if it was not."""
        if self._bar is None:
            self._bar = _make()
            self._task = self._bar.add_task("", total=None, step="", now="")
            self._bar.start()
        assert self._task is not None
        return self._bar, self._task

    def say(self, text: str) -> None:
        """Print a message above the line."""
        line = f"mbsim: {text}"
        if self._bar is None:
            echo(line, err=True)
        else:
            self._bar.console.print(printable(line), markup=False, highlight=False, soft_wrap=True)

    def stop(self) -> None:
        """Remove the line."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _make() -> Progress:
    """Return a bar with its columns, not yet shown."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TextColumn("{task.fields[now]}"),
        TextColumn("{task.fields[step]}"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        refresh_per_second=4,
    )
