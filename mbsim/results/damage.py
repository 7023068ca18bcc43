"""What h5py raises of a damaged result file, as one error that names the file."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

from mbsim.errors import MbsimError, ResultsError

#: What h5py raises where a file is damaged, and numpy where datasets are not of their form.
DAMAGE = (
    *(OSError, RuntimeError, MemoryError),
    *(KeyError, ValueError, TypeError, IndexError, AttributeError),
)
_Read = TypeVar("_Read", bound=Callable[..., Any])


def reads(method: _Read) -> _Read:
    """Turn what h5py raises of a damaged file into one `ResultsError`, by the object's `place`."""

    @functools.wraps(method)
    def reading(self: Any, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except MbsimError:
            raise
        except DAMAGE as error:
            raise ResultsError(f"{self.place}: {said_of(error)}") from None

    return cast(_Read, reading)


def said_of(error: BaseException) -> str:
    """Return what to say of a file that h5py cannot read."""
    text = " ".join(str(error.args[0] if error.args else error).split())
    return f"cannot be read, the file is damaged: {text or type(error).__name__}"
