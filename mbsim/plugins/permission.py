"""Whether users' code may run at all, how long a call of it may take, and how much memory."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

from mbsim.core.machine import first_bytes, free_memory
from mbsim.errors import ModelError
from mbsim.model.elements import Subroutine

#: Scripts that are only looked at.
_NOT_PYTHON = (".m", ".oml")
#: A call of an interpreted function that takes longer than this is told [s].
LONG = 10.0
#: Share of the free memory that the process may take beside what it has, with users' code in it.
_MEMORY_SHARE = 0.8


class CallTooLong(BaseException):
    """A call of a user's function took longer than `--plugin-timeout`."""


class _Limits:
    """What holds for users' code in this process, and which call goes on."""

    def __init__(self) -> None:
        self.allowed = True
        self.timeout = 0.0
        #: When the outermost call began, and of what; time 0 while none goes on.
        self.began = 0.0
        self.name = ""


_limits = _Limits()


def check(path: Path, element: str) -> None:
    """Raise `ModelError` where users' code is not to run."""
    if not _limits.allowed:
        raise ModelError(f"{element}: {path}: not run, for --no-scripts forbids users' code")


def named(user: Subroutine, plugin_files: Sequence[Path]) -> bool:
    """Return whether the user has named the file of a subroutine, or nothing of it would run.

    A deck is data: `mbsim info` runs no script because a deck says so.
    """
    if not user.script_name or Path(user.script_name).suffix.lower() in _NOT_PYTHON:
        return True
    script = Path(user.script_name).absolute()
    return any(script == file.absolute() for file in plugin_files)


def not_run(user: Subroutine) -> dict[str, str]:
    """Return what `mbsim info` says of a script that only the deck names."""
    file = str(Path(user.script_name).absolute())
    return {"file": file, "asks_for": f"not known: info runs it with --plugin {file}"}


@contextlib.contextmanager
def no_scripts(forbid: bool = True) -> Iterator[None]:
    """Forbid users' code, of decks and of `--plugin`, while this is open."""
    before, _limits.allowed = _limits.allowed, _limits.allowed and not forbid
    try:
        yield
    finally:
        _limits.allowed = before


def watched(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a user's function as one whose calls are timed; `name` is for messages."""
    clock, limits = time.perf_counter, _limits

    @wraps(function)
    def called(*arguments: Any) -> Any:
        if limits.began:  # one that another needs
            return function(*arguments)
        limits.name = name
        limits.began = clock()
        try:
            if limits.timeout:
                return _timed(function, arguments)
            return function(*arguments)
        finally:
            limits.began = 0.0

    return called


def _timed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Call a function; the alarm ends it, where the call is Python's."""
    signal.setitimer(signal.ITIMER_REAL, _limits.timeout)
    try:
        return function(*arguments)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextlib.contextmanager
def limited(
    timeout: float | None, tell: Callable[[str], None], interpreted: bool = True
) -> Iterator[None]:
    """Watch over calls of users' functions while a run goes on.

    Parameters
    ----------
    timeout : float or None
        Longest time of a call [s]; None lets calls take as long as they take.
    tell : callable
        Called with a line, once a call, where one takes longer than `LONG`.
    interpreted : bool
        Whether there are functions whose calls can be watched; else only memory is bounded.

    Raises
    ------
    ModelError
        Where this system, or this thread, has no alarm to end a call with.
    """
    main = threading.current_thread() is threading.main_thread()
    if timeout and not (main and hasattr(signal, "setitimer")):
        raise ModelError("plugin_timeout: only in the main thread of a POSIX system")
    before = signal.signal(signal.SIGALRM, _end_call) if timeout else None
    _limits.timeout, outer = timeout or 0.0, _limits.timeout
    over = threading.Event() if interpreted else None
    if over is not None:
        threading.Thread(target=_watch, args=(over, tell), daemon=True).start()
    try:
        with _bounded_memory():
            yield
    finally:
        if over is not None:
            over.set()
        _limits.timeout = outer
        if timeout:
            signal.signal(signal.SIGALRM, before)


def _end_call(number: int, frame: Any) -> None:
    """End the call that goes on."""
    if _limits.began:
        raise CallTooLong(f"the call took longer than {_limits.timeout:g} s, the --plugin-timeout")


def _watch(over: threading.Event, tell: Callable[[str], None]) -> None:
    """Tell of calls that take long, until the run is over."""
    told = 0.0
    while not over.wait(0.1 * LONG):
        began = _limits.began
        if began and began != told and time.perf_counter() - began > LONG:
            told = began
            tell(
                f"{_limits.name} has not returned for {LONG:g} s; --plugin-timeout S ends such a "
                "call, Ctrl-C twice ends the run"
            )


@contextlib.contextmanager
def _bounded_memory() -> Iterator[None]:
    """Let the process take most of the free memory, not more: users' code gets a MemoryError.

    Without this the system ends some process, often this one, without a word.
    """
    try:
        import resource

        used = int(first_bytes("/proc/self/statm").split()[5])
        soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
        free = free_memory()
    except (ImportError, OSError, ValueError, IndexError, AttributeError):
        yield
        return
    if free is None or soft != resource.RLIM_INFINITY:
        yield  # who set a limit knows better
        return
    bound = used * resource.getpagesize() + int(_MEMORY_SHARE * free)
    if hard != resource.RLIM_INFINITY:
        bound = min(bound, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bound, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
