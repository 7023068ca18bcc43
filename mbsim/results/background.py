"""`Background`: a piece of work beside the loop of a run, in another thread."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Background:
    """At most one piece of work in another thread, in the order in which they are begun.

    Compiled code runs without Python's lock, and so do NumPy, zlib and the system's calls: on
    another core the work costs the loop next to nothing.
    """

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def begin(self, work: Callable[[], None]) -> None:
        """Begin a piece of work, when the one before is done; raise what that one raised."""
        self.wait()

        def do() -> None:
            try:
                work()
            except BaseException as error:
                self._failure = error

        thread = threading.Thread(target=do, name="mbsim-writer")
        try:
            thread.start()
        except (RuntimeError, MemoryError):
            do()  # a system that gives no more threads: it is done before the loop goes on
        else:
            self._thread = thread

    def wait(self) -> None:
        """Wait until nothing is being done; raise what the last piece of work raised, once."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def check(self) -> None:
        """Raise what the last piece of work raised, once; what is being done goes on."""
        if self._failure is not None:
            self.wait()
