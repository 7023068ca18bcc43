"""Groups of arrays that many models have alike, as of what they lack: made once, then copied."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar, cast

import numpy as np

Group = TypeVar("Group", bound=tuple[Any, ...])


def copied(group: Group) -> Group:
    """Return a group with arrays of its own; those without elements nobody can change."""
    parts = [
        (value.copy() if value.size else value) if isinstance(value, np.ndarray) else copied(value)
        for value in group
    ]
    kind: Any = type(group)
    return cast(Group, tuple(parts) if kind is tuple else kind(*parts))


def copies(make: Callable[..., Group]) -> Callable[..., Group]:
    """Let a function of a few numbers make its group once for each, and return copies of it."""
    kept = lru_cache(maxsize=64)(make)

    @wraps(make)
    def made(*given: int) -> Group:
        return copied(kept(*given))

    return made
