"""Signals that end a study: Ctrl-C, and those of batch systems and closed terminals."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_STOPPING = ("SIGINT", "SIGTERM", "SIGHUP")


class Stop(KeyboardInterrupt):
    """A signal asks for the end, as Ctrl-C does; `signal` is its number."""

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__()
        self.signal = number


@contextmanager
def stoppable() -> Iterator[None]:
    """Let these signals raise `Stop`; but for a closed terminal's where `nohup` switched it off.

    Ctrl-C a shell switches off for all that it starts in the background, where somebody who sends
    it means it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {}
    for name in _STOPPING:
        number = getattr(signal, name, None)
        off = number is not None and signal.getsignal(number) is signal.SIG_IGN
        if number is not None and not (off and name == "SIGHUP"):
            before[number] = signal.signal(number, _stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _stop(number: int, frame: FrameType | None) -> None:
    raise Stop(number)


def number_of(error: BaseException) -> int:
    """Return the number of the signal that an exception stands for."""
    return int(getattr(error, "signal", signal.SIGINT))
