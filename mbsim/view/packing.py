"""Numbers of a view as bytes: quantised, differenced, in planes of bytes, deflated, base64.

A pack is the length of a JSON text (4 bytes, little-endian), the text, and arrays that begin at
multiples of 4 behind it; the whole is deflated. `static/unpack.js` reads it.
"""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

Table = np.ndarray[Any, Any]
#: Largest whole number that a pose may be in steps: differences of two are in 32 bits.
MOST_STEPS = 2**28


def quantised(values: Table, step: float) -> Table:
    """Return values in whole steps, int32; they are off by half a step at most.

    Raises
    ------
    ValueError
        If a value is not finite, or more than `MOST_STEPS` steps from 0.
    """
    steps = np.rint(np.asarray(values, dtype=np.float64) / step)
    if not (np.abs(steps) <= MOST_STEPS).all():
        raise ValueError("a value is not finite, or too far from 0 for its step")
    return steps.astype(np.int32)


def planes(table: Table) -> tuple[Table, int, int]:
    """Return whole numbers (rows, columns) as bytes that deflate well.

    Each column is differenced along the rows, once or twice as deflates better, the sign put into
    the lowest bit, and the bytes of a weight put together: zeros where numbers are small.

    Returns
    -------
    bytes : ndarray of uint8
        The planes of lowest bytes first, each column by column.
    count : int
        Number of planes, 1 to 4.
    order : int
        How often columns were differenced.
    """
    best: tuple[Table, int, int] | None = None
    size = 0
    for order in (1, 2):
        columns = np.ascontiguousarray(table.T.astype(np.int64))
        for _ in range(order):
            columns[:, 1:] = np.diff(columns, axis=1)
        folded = np.where(columns < 0, -2 * columns - 1, 2 * columns).astype("<u8").reshape(-1)
        top = int(folded.max(initial=0))
        if top >= 2**32:
            continue
        count = max(1, -(-top.bit_length() // 8))
        parts = folded.astype("<u4").view("u1").reshape(-1, 4)[:, :count]
        found = np.ascontiguousarray(parts.T).reshape(-1)
        packed = len(zlib.compress(found.tobytes(), 1))
        if best is None or packed < size:
            best, size = (found, count, order), packed
    if best is None:
        raise ValueError("differences of the rows do not fit into 32 bits")
    return best


def pack(about: Mapping[str, Any], arrays: Mapping[str, Table]) -> bytes:
    """Return the deflated pack of facts and arrays; these are uint8, int32, uint32 or float32."""
    places: dict[str, Any] = {}
    parts: list[bytes] = []
    at = 0
    for name, array in arrays.items():
        kind = array.dtype.newbyteorder("<").str.lstrip("<|")
        if kind not in ("u1", "u2", "i4", "u4", "f4"):
            raise TypeError(f"{name}: {array.dtype} is no type of a pack")
        data = np.ascontiguousarray(array.astype(f"<{kind}")).tobytes()
        places[name] = [kind, at, array.size]
        data += bytes(-len(data) % 4)
        parts.append(data)
        at += len(data)
    text = json.dumps({**about, "arrays": places}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return zlib.compress(struct.pack("<I", len(text)) + text + b"".join(parts), 9)


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, Table]]:
    """Return facts and arrays of a pack."""
    raw = zlib.decompress(data)
    (length,) = struct.unpack_from("<I", raw)
    about = json.loads(raw[4 : 4 + length])
    first = 4 + length
    arrays = {
        name: np.frombuffer(raw, np.dtype(f"<{kind}"), count, first + at)
        for name, (kind, at, count) in about.pop("arrays").items()
    }
    return about, arrays


def from_planes(data: Table, count: int, order: int, rows: int, columns: int) -> Table:
    """Return the whole numbers (rows, columns) of `planes`."""
    folded = np.zeros((rows * columns, 4), dtype="u1")
    folded[:, :count] = data.reshape(count, -1).T
    values = folded.view("<u4").reshape(columns, rows).astype(np.int64)
    found = np.where(values % 2 == 1, -(values + 1) // 2, values // 2)
    for _ in range(order):
        found = np.cumsum(found, axis=1)
    whole: Table = found.T.astype(np.int32)
    return whole


def text_of(data: bytes) -> str:
    """Return bytes as base64, which no HTML has to escape."""
    return base64.b64encode(data).decode("ascii")
