"""What an array is for: each field of a group of arrays is declared with one of three tags.

CONSTANT: a run makes it from the model and its settings, and a resumed run makes the same;
STATE: goes on from one step to the next, and so is what a checkpoint holds;
SCRATCH: follows from those within one call of compiled code; when that has come back, and its rows
are taken, it may be filled with NaN.

A group says what its fields are, `@tags.constant`, and a field that is something else says that:

    @tags.constant
    class Equations(NamedTuple):
        first: I1
        active: tags.State[I1]

Whoever needs all fields of a tag asks here: no list of names is kept anywhere else.
"""

from __future__ import annotations

import functools
import typing
from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Annotated, Any, TypeVar

import numpy as np

Array = np.ndarray[Any, Any]
_T = TypeVar("_T")
_Group = TypeVar("_Group", bound=type)


class Tag(Enum):
    """What an array is for."""

    CONSTANT = "constant"
    STATE = "state"
    SCRATCH = "scratch"


CONSTANT, STATE, SCRATCH = Tag

Constant = Annotated[_T, CONSTANT]
State = Annotated[_T, STATE]
Scratch = Annotated[_T, SCRATCH]

_of_groups: dict[type, Tag] = {}


def constant(group: _Group) -> _Group:
    """Declare all fields of a group as constants, but those that say otherwise."""
    _of_groups[group] = CONSTANT
    return group


def state(group: _Group) -> _Group:
    """Declare all fields of a group as state, but those that say otherwise."""
    _of_groups[group] = STATE
    return group


def scratch(group: _Group) -> _Group:
    """Declare all fields of a group as scratch, but those that say otherwise."""
    _of_groups[group] = SCRATCH
    return group


def _is_array(hint: Any) -> bool:
    return hasattr(hint, "__metadata__")


def tag_of(group: type, hint: Any) -> Tag | None:
    """Return the tag of a field by its annotation, else its group's, None where there is none."""
    own = [mark for mark in hint.__metadata__ if isinstance(mark, Tag)]
    return own[-1] if own else _of_groups.get(group)


@functools.cache
def _fields(group: type) -> tuple[tuple[str, Tag | type, str], ...]:
    """Return name, tag and kind of each array of a group; of inner groups name and class."""
    found: list[tuple[str, Tag | type, str]] = []
    for name, hint in typing.get_type_hints(group, include_extras=True).items():
        if not _is_array(hint):
            found.append((name, hint, ""))
            continue
        tag = tag_of(group, hint)
        if tag is None:
            raise TypeError(f"{group.__name__}.{name}: no tag says what this array is for")
        dtype, ndim = hint.__metadata__[:2]
        found.append((name, tag, f"{dtype}, {ndim} axes"))
    return tuple(found)


def layout(group: type, tag: Tag, path: str = "") -> dict[str, str]:
    """Return type and number of axes of all arrays with a tag, by path, in a class of groups.

    Raises
    ------
    TypeError
        If a field has no tag.
    """
    found: dict[str, str] = {}
    for name, what, kind in _fields(group):
        if isinstance(what, type):
            found |= layout(what, tag, f"{path}{name}/")
        elif what is tag:
            found[path + name] = kind
    return found


def arrays(whole: Any, tag: Tag, path: str = "") -> Iterator[tuple[str, Array]]:
    """Yield path and array of all fields with a tag, in a group or a group of groups."""
    group: Any = type(whole)
    for name, what, _ in _fields(group):
        field = getattr(whole, name)
        if isinstance(what, type):
            yield from arrays(field, tag, f"{path}{name}/")
        elif what is tag:
            yield path + name, field


def at_path(whole: Any, path: str) -> Array:
    """Return the array at a path of `arrays`, in a group or a group of groups."""
    found: Array = functools.reduce(getattr, path.split("/"), whole)
    return found


def copies(whole: Any, tag: Tag, path: str = "") -> dict[str, Array]:
    """Return copies of all arrays with a tag, by path."""
    return {name: np.array(array) for name, array in arrays(whole, tag, path)}


def put_back(whole: Any, tag: Tag, kept: Mapping[str, Any], path: str = "") -> None:
    """Fill all arrays with a tag with what `copies` returned; others in `kept` are left alone."""
    for name, array in arrays(whole, tag, path):
        array[...] = kept[name]


def forget(whole: Any, tag: Tag) -> None:
    """Fill all arrays with a tag with NaN; integers, which may be indices, with 0."""
    for _, array in arrays(whole, tag):
        array[...] = 0 if array.dtype.kind == "i" else np.nan
