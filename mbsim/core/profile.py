"""Where the wall time of a run goes: a clock for parts of Python code, and one for compiled hooks.

`part("read")` counts the seconds within to "read", less those of parts within it. Nothing is
counted, and no clock looked at, unless `running` is set (`mbsim run --profile`).

Compiled code is timed from outside: `timed` returns the address of a small function that reads the
processor's counter, calls what stands behind another address, and counts the difference to a part,
less what parts within it took. No kernel knows of it, and without --profile there is none of it.
"""

from __future__ import annotations

import importlib
import platform
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np

#: Parts of Python code, in the order of a run; the last is what no other part claims.
PARTS = ("import", "compile", "load", "read", "build", "start", "loop", "storing", "rest")
#: Parts of the compiled loop that hooks are counted to; what is left is the method's own work.
LOOP_PARTS = (
    "detect",
    "contacts",
    "forces",
    "joints",
    "linear_algebra",
    "evaluation",
    "step_control",
    "rows",
)
#: Whether the loop can be divided: its clock is the counter of x86 processors.
DIVIDES = platform.machine().lower() in ("x86_64", "amd64")

_UNCLAIMED = PARTS[-1]


class Profile:
    """Seconds a part, and of the parts of the loop how often they were called."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(PARTS, 0.0)
        self._hooks: Hooks | None = None
        self._inside = [_UNCLAIMED]
        self._since = time.perf_counter()

    @property
    def hooks(self) -> Hooks:
        """The clock of compiled hooks."""
        if self._hooks is None:
            self._hooks = Hooks()
        return self._hooks

    def enter(self, name: str) -> None:
        """Count to another part from here on."""
        self._count()
        self._inside.append(name)

    def leave(self) -> None:
        """Count to the part before again."""
        self._count()
        self._inside.pop()

    def _count(self) -> None:
        now = time.perf_counter()
        self.seconds[self._inside[-1]] += now - self._since
        self._since = now

    def loop(self, advance: Callable[..., int]) -> Callable[..., int]:
        """Return `advance`, its seconds counted as those of the loop."""

        def counted(*given: Any) -> int:
            self.enter("loop")
            before = self.hooks.counts()
            try:
                return advance(*given)
            finally:
                self.hooks.add(before)
                self.leave()

        return counted

    def stats(self) -> dict[str, float]:
        """Return what was counted so far, as results keep it."""
        self._count()
        found: dict[str, float] = {f"profile_{name}_s": s for name, s in self.seconds.items()}
        if self._hooks is None or not DIVIDES:
            return found
        left = self.seconds["loop"]
        for name, seconds, calls in self._hooks.parts():
            found[f"profile_loop_{name}_s"] = seconds
            found[f"profile_loop_{name}_calls"] = calls
            left -= seconds
        return found | {"profile_loop_method_s": max(0.0, left)}


class Hooks:
    """Hooks of compiled code that are timed: a table of counts, and what counts."""

    def __init__(self) -> None:
        from mbsim.core.clocked import CURRENT, compile_counter

        # a row a part, the method's own work behind them: ticks, calls; then when it was counted
        # last, and to which part
        self._table = np.zeros((len(LOOP_PARTS) + 2, 2), dtype=np.int64)
        self._table[-1, CURRENT] = len(LOOP_PARTS)
        self._loop = np.zeros((len(LOOP_PARTS), 2), dtype=np.int64)
        self._made: dict[tuple[int, int], int] = {}
        self._known: set[int] = set()
        self._engines: list[Any] = []  # machine code that lives as long as the process may call it
        if DIVIDES:
            engine, self._ticks = compile_counter()
            self._engines.append(engine)
            self._began = time.perf_counter(), self._ticks()

    def counts(self) -> Any:
        """Return what hooks have counted, whoever called them."""
        return self._table[: len(LOOP_PARTS)].copy()

    def add(self, before: Any) -> None:
        """Let what was counted since `before` be the loop's: Python calls hooks as well."""
        self._loop += self._table[: len(LOOP_PARTS)] - before

    def parts(self) -> Iterator[tuple[str, float, int]]:
        """Yield name, seconds and calls of the loop's parts."""
        seconds, ticks = time.perf_counter() - self._began[0], self._ticks() - self._began[1]
        for name, (counted, calls) in zip(LOOP_PARTS, self._loop, strict=True):
            yield name, float(counted) * seconds / ticks, int(calls)

    def timed(self, address: int, part: str, signature: Any) -> int:
        """Return the address of what counts to a part what stands behind another address.

        What counts already is returned as it is, and so is what stands for no function.
        """
        if address <= 0 or address in self._known or not DIVIDES:
            return address
        from mbsim.core.clocked import compile_clocked

        key = address, LOOP_PARTS.index(part)
        if key not in self._made:
            table, rows = int(self._table.ctypes.data), len(LOOP_PARTS) + 1
            engine, self._made[key] = compile_clocked(*key, signature, table, rows)
            self._engines.append(engine)
            self._known.add(self._made[key])
        return self._made[key]


#: What is counted, None where nothing is.
running: Profile | None = None


@contextmanager
def profiling(before: float = 0.0) -> Iterator[Profile]:
    """Count what happens within; what an outer call counts already goes on.

    `before` is what the process took until then [s], which is counted to its imports.
    """
    global running
    if running is not None:
        yield running
        return
    running = Profile()
    running.seconds["import"] = before
    load = getattr(importlib._bootstrap, "_find_and_load", None)
    if load is not None:
        importlib._bootstrap._find_and_load = _counting(load, running)  # type: ignore[attr-defined]
    try:
        yield running
    finally:
        running = None
        if load is not None:
            importlib._bootstrap._find_and_load = load  # type: ignore[attr-defined]


def _counting(load: Callable[..., Any], profile: Profile) -> Callable[..., Any]:
    """Return what loads modules, its seconds counted: Python asks it only for new ones.

    A Python without it counts imports to the part that asks for them.
    """

    def counted(*given: Any) -> Any:
        if threading.current_thread() is not threading.main_thread():
            return load(*given)
        profile.enter("import")
        try:
            return load(*given)
        finally:
            profile.leave()

    return counted


def part(name: str) -> AbstractContextManager[None]:
    """Count the seconds within to a part, where a profile runs."""
    return nullcontext() if running is None else _counted(running, name)


@contextmanager
def _counted(profile: Profile, name: str) -> Iterator[None]:
    profile.enter(name)
    try:
        yield
    finally:
        profile.leave()
