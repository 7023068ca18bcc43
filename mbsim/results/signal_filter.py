"""`SignalFilter`: which signals a run records, of all that it could."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.results.names import PARTS, is_pattern, nearest

Table = np.ndarray[Any, Any]
#: Names that a message lists; more would hide it.
_MOST_NAMED = 12
_PARTS = {"mag", *(part for parts in PARTS.values() for part in parts)}


class SignalFilter:
    """Names and patterns of signals; none at all stand for every signal.

    Parameters
    ----------
    patterns : sequence of str
        Names as `Results` takes them, whole or their beginnings, with wildcards between slashes:
        ``bodies/2/position``, ``contacts/*/force``, ``joints``, ``state``.
    """

    def __init__(self, patterns: Sequence[str] = ()) -> None:
        self.patterns = [pattern.strip("/") for pattern in patterns]
        self._split = [pattern.split("/") for pattern in self.patterns]

    def __call__(self, name: str) -> bool:
        """Return whether a signal is recorded."""
        segments = name.split("/")
        return not self._split or any(_asks(pattern, segments) for pattern in self._split)

    def element(self, group: str, id: int) -> bool:
        """Return whether any signal of an element may be recorded."""
        return not self._split or any(
            all(map(fnmatchcase, (group, str(id)), pattern)) for pattern in self._split
        )

    def elements(self, group: str, ids: Sequence[int]) -> list[int]:
        """Return the places of those of `ids` that have columns in the group's datasets."""
        return [k for k, id in enumerate(ids) if self.element(group, id)]

    def stacked(
        self, group: str, ids: Sequence[int], tables: Mapping[str, Callable[[], Table]]
    ) -> Iterator[tuple[str, Callable[[], Table]]]:
        """Yield what makes datasets of all elements of a group, (rows, elements, ...).

        A signal asked of one element is recorded of all that the group's dataset ``id`` has.
        """
        columns = self.elements(group, ids)
        for signal, table in tables.items():
            if any(self(f"{group}/{ids[k]}/{signal}") for k in columns):
                whole = len(columns) == len(ids)
                yield f"{group}/{signal}", table if whole else partial(_chosen, table, columns)

    def check(self, names: Iterable[str]) -> None:
        """Raise `ModelError` where a pattern stands for nothing that can be recorded."""
        known = list(names)
        split = [name.split("/") for name in known]
        faults = []
        for pattern, wanted in zip(self.patterns, self._split, strict=True):
            if any(_asks(wanted, segments) for segments in split):
                continue
            near = [] if is_pattern(pattern) else nearest(pattern, known)
            hint = f"; did you mean {' or '.join(near)}?" if near else _there(known)
            faults.append(f"--signals {pattern}: this model has no such signal{hint}")
        if faults:
            raise ModelError("\n".join(faults))


def _chosen(table: Callable[[], Table], columns: list[int]) -> Table:
    """Return some elements' columns of a table."""
    chosen: Table = table()[:, columns]
    return chosen


def _there(known: Sequence[str]) -> str:
    """Return which signals there are, the first of many."""
    more = f" and {len(known) - _MOST_NAMED} more" if len(known) > _MOST_NAMED else ""
    return f"; there is {', '.join(sorted(known)[:_MOST_NAMED])}{more}" if known else ""


def _asks(pattern: Sequence[str], segments: Sequence[str]) -> bool:
    """Return whether a pattern stands for a name, a group that it is in, or a part of it."""
    if len(pattern) == len(segments) + 1 and pattern[-1] in _PARTS:
        pattern = pattern[:-1]
    return len(pattern) <= len(segments) and all(map(fnmatchcase, segments, pattern))
