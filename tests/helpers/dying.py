"""A call of the system at which a process dies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Killed(BaseException):
    """The process is killed here."""


def dying(plain: Callable[..., Any], call: int) -> Callable[..., Any]:
    """Return `plain`, but at the given call of it, the first being 1, the process is killed."""
    left = call

    def called(*given: Any, **named: Any) -> Any:
        nonlocal left
        left -= 1
        if left == 0:
            raise Killed
        return plain(*given, **named)

    return called
