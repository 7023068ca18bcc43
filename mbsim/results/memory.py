"""Results in memory: the groups and datasets of a result file, without a file.

What a run without a folder records stays in numpy arrays, under the names that a file has; it is
read as a file is. Making an HDF5 file, even one in memory, takes longer than a small run.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsim.errors import ResultsError

if TYPE_CHECKING:
    from mbsim.results.identity import Identity

Table = np.ndarray[Any, Any]


class MemoryDataset:
    """One dataset: an array with attributes. What is read is a copy, as of a file.

    Values may be given as a function that makes them: it is called where they are looked at.
    """

    def __init__(self, parent: MemoryGroup, name: str, values: Any) -> None:
        self.parent = parent
        self.name = name
        self.attrs: dict[str, Any] = {}
        self._parts: list[Any] = []
        self.append(values)

    def __getstate__(self) -> dict[str, Any]:
        """Let a copy in another process have the values."""
        return {**vars(self), "_parts": [self.values]}

    def append(self, rows: Table | Callable[[], Table]) -> None:
        """Add rows; an array that is given is another's, who fills it anew."""
        self._parts.append(rows if callable(rows) else np.array(rows))

    @property
    def values(self) -> Table:
        """All rows."""
        parts = self._parts
        if len(parts) > 1 or callable(parts[0]):
            made = [np.array(part()) if callable(part) else part for part in parts]
            self._parts = parts = made if len(made) == 1 else [np.concatenate(made)]
        found: Table = parts[0]
        return found

    @property
    def file(self) -> MemoryFile:
        """What this belongs to."""
        return self.parent.file

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows, elements, components."""
        return tuple(self.values.shape)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return self.values.ndim

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of a value."""
        found: np.dtype[Any] = self.values.dtype
        return found

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, index: Any) -> Any:
        found = self.values[index]
        return found.copy() if isinstance(found, np.ndarray) else found


class MemoryGroup:
    """A group: members by name, of which a path may name one within another; attributes."""

    def __init__(self, parent: MemoryGroup | None, name: str) -> None:
        self.parent = parent
        self.name = name
        self._attrs: dict[str, Any] = {}
        self._later: Callable[[], Mapping[str, Any]] | None = None
        self._members: dict[str, MemoryGroup | MemoryDataset] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Let a copy in another process have the attributes."""
        return {**vars(self), "_attrs": self.attrs, "_later": None}

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes, those that are made where somebody looks at them too."""
        if self._later is not None:
            later, self._later = self._later, None
            self._attrs |= later()
        return self._attrs

    def note(self, facts: Mapping[str, Any]) -> None:
        """Set attributes, without a look at the others."""
        self._attrs.update(facts)

    def note_later(self, make: Callable[[], Mapping[str, Any]]) -> None:
        """Let attributes be those that a function gives, which is called where they are read."""
        self._later = make

    @property
    def file(self) -> MemoryFile:
        """What this belongs to."""
        assert self.parent is not None
        return self.parent.file

    def get(self, path: str, default: Any = None) -> Any:
        """Return a member, or one of its members; the default where there is none."""
        found: Any = self
        for name in path.strip("/").split("/"):
            if name:
                found = found._members.get(name) if isinstance(found, MemoryGroup) else None
                if found is None:
                    return default
        return found

    def __getitem__(self, path: str) -> Any:
        found = self.get(path)
        if found is None:
            raise KeyError(f"{path} is not in {self.name}")
        return found

    def __contains__(self, path: object) -> bool:
        return isinstance(path, str) and self.get(path) is not None

    def __delitem__(self, path: str) -> None:
        group, _, last = path.strip("/").rpartition("/")
        del self[group]._members[last]

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self._members)

    def keys(self) -> list[str]:
        """Return the names of members, sorted as those of a file are."""
        return sorted(self._members)

    def items(self) -> list[tuple[str, Any]]:
        """Return names with members."""
        return [(name, self._members[name]) for name in self.keys()]

    def visititems(self, note: Callable[[str, Any], None]) -> None:
        """Call with path and member, for all that are below this."""
        for path, item in self._below():
            note(path, item)

    def visit(self, note: Callable[[str], None]) -> None:
        """Call with the path of all that are below this."""
        self.visititems(lambda name, item: note(name))

    def _below(self) -> Iterator[tuple[str, Any]]:
        for name, item in self.items():
            yield name, item
            if isinstance(item, MemoryGroup):
                for below, other in item._below():
                    yield f"{name}/{below}", other

    def create_group(self, path: str) -> MemoryGroup:
        """Return a group, made with those above it where they are not there."""
        found: MemoryGroup = self
        for name in path.strip("/").split("/"):
            member = found._members.get(name)
            if member is None:
                member = MemoryGroup(found, f"{found.name.rstrip('/')}/{name}")
                found._members[name] = member
            assert isinstance(member, MemoryGroup)
            found = member
        return found

    def create_dataset(self, path: str, data: Any) -> MemoryDataset:
        """Return a new dataset, in the place of one that is there."""
        group, _, last = path.strip("/").rpartition("/")
        there = self._members.get(group) if group else self
        holder = there if isinstance(there, MemoryGroup) else self.create_group(group)
        made = MemoryDataset(holder, f"{holder.name.rstrip('/')}/{last}", data)
        holder._members[last] = made
        return made


class MemoryFile(MemoryGroup):
    """The root of results in memory."""

    driver = "memory"

    def __init__(self) -> None:
        super().__init__(None, "/")
        self._open = True

    @property
    def file(self) -> MemoryFile:
        """Itself."""
        return self

    def __bool__(self) -> bool:
        return self._open

    def close(self) -> None:
        """Let go of all that is held."""
        self._open = False
        self._members.clear()
        self._attrs.clear()
        self._later = None


class MemoryStore:
    """What `Store` is for a file, for results that stay in memory.

    `about` has digests of what the run is made of: made where somebody asks.
    """

    def __init__(self, about: Identity | None = None) -> None:
        self._about = about
        self.file = self._new_file()
        self.broken = False
        self.failure: ResultsError | None = None
        self.rows = self.rows_at_once = 0

    def _new_file(self) -> MemoryFile:
        """Return a file that says what the run is made of."""
        made, about = MemoryFile(), self._about
        if about is not None:
            made.note_later(lambda: about.digests)
        return made

    @contextlib.contextmanager
    def writing(self) -> Iterator[MemoryFile]:
        """Let nothing be kept any more once something was raised: rows may be nowhere else."""
        try:
            yield self.file
        except MemoryError:
            self.abandon()
            self.failure = ResultsError("results in memory: there is not enough memory")
            raise self.failure from None
        except BaseException:
            self.abandon()
            raise

    def update(
        self,
        rows: Mapping[str, Table] | Mapping[str, Callable[[], Table]] | None = None,
        values: Mapping[str, Any] | None = None,
        constants: Mapping[str, Callable[[], Table]] | None = None,
        attributes: Mapping[str, Mapping[str, Any]] | None = None,
        remove: Iterable[str] = (),
        last: bool = False,
    ) -> None:
        """Change what is held; arguments as of `Store.update`, rows may be what makes them."""
        if self.broken:
            return
        with self.writing() as file:
            for name in remove:
                if name in file:
                    del file[name]
            for name, table in (rows or {}).items():
                before = file.get(name)
                if before is None:
                    file.create_dataset(name, table)
                else:
                    before.append(table)
            for name, given in {**(values or {}), **(constants or {})}.items():
                file.create_dataset(name, given)
            for name, facts in (attributes or {}).items():
                item = file if name == "/" else file.get(name)
                if item is None:
                    item = file.create_group(name)
                if isinstance(item, MemoryGroup):
                    item.note(facts)
                else:
                    item.attrs.update(facts)

    def shorten(self, length: Callable[[str], int]) -> NoReturn:
        """Nothing is gone on from: there is no checkpoint in memory."""
        raise AssertionError("results in memory are not resumed")

    def begin_anew(self, resume: bool) -> None:
        """Drop all that was written."""
        if not self.broken:
            self.file = self._new_file()

    def abandon(self) -> None:
        """Let go of all that is held; nothing is kept from here on."""
        self.broken = True
        self.file.close()

    def fail(self, reason: str) -> NoReturn:
        """Memory has no room that is known beforehand."""
        raise AssertionError(reason)

    stop = fail

    def room(self) -> int | None:
        """Return None: nobody knows."""
        return None

    def sum_ahead(self) -> None:
        """There are no checksums."""

    def complete(self) -> None:
        """No rows wait."""

    def mark(self) -> None:
        """Nothing is published."""

    def publish(self) -> None:
        """Nothing is published."""

    def finish(self) -> MemoryFile | None:
        """Return what is held."""
        return None if self.broken else self.file
