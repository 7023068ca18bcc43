"""Files with something wrong in them: bytes, words, numbers and HDF5 objects changed at random."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

#: Numbers that go wrong first, as texts and as 8 bytes.
_NUMBERS = (
    *("0", "-1", "1e308", "-1e308", "1e-308", "nan", "inf", "1e999", "2147483648", "99999999999"),
    *("", " ", "1 2", "0x10", "1,5", "1D3", "\u0663", "TRUE", "TIME", "1e5", "1e12", "1e-9", "7"),
)
_WHOLE = (0, 1, 7, 255, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_]\w*")


def bytes_changed(data: bytes, chance: random.Random) -> bytes:
    """Return a file with some of its bytes changed, taken out, doubled or cut off."""
    made = bytearray(data)
    for _ in range(1 + int(chance.expovariate(0.7))):
        at = chance.randrange(len(made) + 1)
        length = min(len(made) - at, int(chance.expovariate(0.1)) + 1)
        kind = chance.randrange(8)
        if kind < 2 and at < len(made):
            made[at] ^= 1 << chance.randrange(8)
        elif kind == 2 and at < len(made):
            made[at] = chance.choice((0, 1, 127, 128, 255, chance.randrange(256)))
        elif kind < 5:
            size, code = chance.choice(((2, "H"), (4, "I"), (8, "Q")))
            value = chance.choice((*_WHOLE, at, len(made), chance.randrange(len(data) + 1)))
            made[at : at + size] = struct.pack(f"<{code}", value % 256**size)
        elif kind == 5:
            del made[at : at + length]
        elif kind == 6:
            made[at:at] = made[at : at + length]
        elif chance.random() < 0.3:
            del made[at:]
        else:
            made[at : at + length] = chance.randbytes(length)
    return bytes(made)


def text_changed(data: bytes, chance: random.Random) -> bytes:
    """Return a text with numbers, words or lines changed."""
    for _ in range(1 + int(chance.expovariate(0.7))):
        kind = chance.randrange(8)
        if kind < 3:
            data = _replaced(data, _NUMBER, chance.choice(_NUMBERS).encode(), chance)
        elif kind < 5:
            words = _WORD.findall(data) or [b"x"]
            data = _replaced(data, _WORD, chance.choice(words), chance)
        elif kind == 5:
            data = _replaced(data, _NUMBER, chance.choice(_NUMBER.findall(data) or [b"1"]), chance)
        elif kind == 6:
            lines = data.split(b"\n")
            at, to = (chance.randrange(len(lines)) for _ in range(2))
            lines[at : at + 1] = chance.choice(([], [lines[at]] * 2, [lines[to]]))
            data = b"\n".join(lines)
        else:
            data = bytes_changed(data, chance)
    return data


def _replaced(
    data: bytes, pattern: re.Pattern[bytes], value: bytes, chance: random.Random
) -> bytes:
    """Return a text with one place of a pattern, chosen at random, given another value."""
    places = [found.span() for found in pattern.finditer(data)]
    if not places:
        return data
    begin, end = chance.choice(places)
    return data[:begin] + value + data[end:]


_SHAPES = ((), (0,), (1,), (3,), (10,), (10, 3), (10, 1, 3), (2, 2, 2, 2), (0, 3), (10, 1))
_TYPES = ("f8", "f4", "i4", "i8", "u1", "S5", "O", "?", "c16", [("a", "f8"), ("b", "S3")], "enum")


def _value(chance: random.Random) -> Any:
    """Return something that a dataset or an attribute may hold."""
    import h5py

    shape, kind = chance.choice(_SHAPES), chance.choice(_TYPES)
    if chance.random() < 0.1:
        return h5py.Empty("f8")
    if chance.random() < 0.3:
        return chance.choice((0, -1, 1.5, float("nan"), 2**40, "text", "\x1b[31m", b"\xff", ""))
    if kind == "O":
        return np.full(shape, "text", dtype=h5py.string_dtype())
    if kind == "enum":
        return np.zeros(shape, dtype=h5py.enum_dtype({"A": 0, "B": 1}))
    return np.full(shape, chance.choice((0, 1, 7)), dtype=np.dtype(kind))


def objects_changed(path: Path, chance: random.Random) -> None:
    """Change groups, datasets, links and attributes of an HDF5 file."""
    import h5py

    with h5py.File(path, "r+") as file:
        for _ in range(1 + int(chance.expovariate(0.7))):
            names: list[str] = []
            file.visit(names.append)
            name = chance.choice(names) if names else "a"
            holder = file[name] if chance.random() < 0.8 and name in file else file
            kind = chance.randrange(9)
            try:
                if kind < 3:
                    facts = list(holder.attrs) or ["a"]
                    holder.attrs[chance.choice(facts)] = _value(chance)
                elif kind == 3 and len(holder.attrs):
                    del holder.attrs[chance.choice(list(holder.attrs))]
                elif kind == 4:
                    del file[name]
                elif kind == 5:
                    file.move(name, name + chance.choice(("", "/9", "x", "/id")))
                else:
                    if chance.random() < 0.8:
                        del file[name]
                    elif isinstance(holder, h5py.Group):
                        name = f"{holder.name}/{chance.choice(('id', 'label', '9', '-1', 'é'))}"
                    _put(file, name, chance)
            except (OSError, ValueError, KeyError, TypeError, RuntimeError):
                continue  # HDF5 does not take this one


def _put(file: Any, name: str, chance: random.Random) -> None:
    """Put something at a name of an HDF5 file: also links, and datasets that take no room."""
    import h5py

    kind = chance.randrange(8)
    if kind < 4:
        file[name] = _value(chance)
    elif kind == 4:
        file.create_group(name)
    elif kind == 5:
        target = chance.choice(("/", "/time", "/bodies", name, "/nothing"))
        file[name] = h5py.SoftLink(target) if chance.random() < 0.5 else file[target]
    elif kind == 6:
        shape = chance.choice(((2**50,), (2**36,), (2**33, 3), (10, 2**33), (2**20, 2**20)))
        file.create_dataset(name, shape, "f8", chunks=True, fillvalue=chance.choice((None, 1.0)))
    else:
        file[name] = h5py.ExternalLink(chance.choice(("other.h5", "/dev/zero")), "/time")
