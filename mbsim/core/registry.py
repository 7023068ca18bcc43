"""Named entries that live one in a file: a file registers itself by being imported."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

Entry = TypeVar("Entry")


class Registry(Generic[Entry]):
    """Entries found in the modules of one package, read at the first question.

    They are in the order of `key`, where there is one, and of their names.
    """

    def __init__(self, package: str, key: Callable[[Entry], int] = lambda entry: 0) -> None:
        self._package = package
        self._key = key
        self._entries: dict[str, Entry] = {}
        self._loaded = False
        self._names: tuple[str, ...] = ()

    def put(self, name: str, entry: Entry) -> None:
        """Add `entry`; a name taken twice is a programming error."""
        if name in self._entries:
            raise ValueError(f"{name} is registered twice in {self._package}")
        self._entries[name] = entry
        self._names = ()

    def _load(self) -> None:
        """Import every module of the package, so that each registers itself."""
        if not self._loaded:
            self._loaded = True
            package = importlib.import_module(self._package)
            for module in pkgutil.iter_modules(package.__path__):
                importlib.import_module(f"{self._package}.{module.name}")

    def __getitem__(self, name: str) -> Entry:
        if not self._loaded:
            self._load()
        return self._entries[name]

    def __contains__(self, name: str) -> bool:
        if not self._loaded:
            self._load()
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        self._load()
        if not self._names:
            entries = self._entries
            self._names = tuple(sorted(entries, key=lambda name: (self._key(entries[name]), name)))
        return iter(self._names)
