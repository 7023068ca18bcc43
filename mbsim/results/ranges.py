"""`Ranges`: where bytes of a file were written, in little memory however many writes there are."""

from __future__ import annotations

#: So many ranges are kept before those that touch are made one.
_FEW = 256


class Ranges:
    """Ranges [first, end] of bytes.

    Chunks of a long run lie side by side, but what HDF5 writes between them does not come in their
    order: as many ranges as writes would be there if those that touch stayed apart.
    """

    def __init__(self) -> None:
        self._found: list[list[int]] = []
        self._most = _FEW

    def add(self, first: int, end: int) -> None:
        """Add a range."""
        found = self._found
        if found and found[-1][0] <= first <= found[-1][1]:
            found[-1][1] = max(found[-1][1], end)
            return
        found.append([first, end])
        if len(found) > self._most:
            # twice as many as are left: adding one costs the same, however many there are
            self._most = max(_FEW, 2 * len(self.merged()))

    def merged(self) -> list[list[int]]:
        """Return the ranges in order, those that touch as one."""
        found: list[list[int]] = []
        for first, end in sorted(self._found):
            if found and first <= found[-1][1]:
                found[-1][1] = max(found[-1][1], end)
            else:
                found.append([first, end])
        self._found = found
        return found

    def copied(self) -> Ranges:
        """Return the same ranges, to which others are added."""
        made = Ranges()
        made._found, made._most = [*map(list, self._found)], self._most
        return made

    def __len__(self) -> int:
        return len(self._found)
