"""Error bars of a run with `--verify`, as they are read: `results.errors`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from mbsim.errors import UnknownSignal
from mbsim.results.form import plain, values_of
from mbsim.results.names import PARTS

if TYPE_CHECKING:
    from mbsim.results.reading import Results


class Errors:
    """Error bars: `errors["bodies/2/position"]`, shape (n,), a bar for every row.

    A vector's bar is the length by which it may be off, so each component has the same one;
    a request has its own for each column, (n, 8). Largest values (`contacts/1/peak_force`) and the
    times of `events` have theirs as well.
    """

    def __init__(self, results: Results) -> None:
        self._results = results

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._stored(name) is not None

    def __getitem__(self, name: str) -> Any:
        stored = self._stored(name)
        if stored is None:
            raise UnknownSignal(f"{name} has no error bar: run it with --verify, or verify=True")
        values, (_, location, part) = values_of(stored), self._results.located(name)
        if location is not None and location.column is not None:
            values = values[location.column] if values.ndim == 1 else values[:, location.column]
        if part is not None and values.ndim == 2:
            values = values[:, PARTS[8][part]]
        return plain(values)

    def reproducible_until(self, name: str) -> float:
        """Return the time from which a signal is not reproducible; inf if there is none."""
        stored = self._stored(name)
        return math.inf if stored is None else float(stored.attrs["reproducible_until"])

    def _stored(self, name: str) -> Any:
        """Return the dataset of a signal's bar, None where there is none."""
        file, location, _ = self._results.located(name)
        return None if location is None else file.get(f"errors/{location.stored}")
