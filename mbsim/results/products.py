"""Pages, pictures and models made of results: each is written whole, in the place of its like only.

What a command's -o names may be a result file or a deck by mistake: what is there and of another
kind is left alone.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from mbsim.core.stored import read_regular
from mbsim.errors import ModelError, ResultsError
from mbsim.results.files import replace_bytes

#: So many bytes tell what a file is.
_HEAD = 4096
#: Whether a file is of a kind, by its first bytes.
_KINDS: dict[str, Callable[[bytes], bool]] = {
    "picture": lambda head: head.startswith(b"\x89PNG\r\n\x1a\n") or b"<svg" in head,
    "PNG picture": lambda head: head.startswith(b"\x89PNG\r\n\x1a\n"),
    "GIF picture": lambda head: head.startswith(b"GIF8"),
    "film": lambda head: head[4:8] == b"ftyp",
    "page": lambda head: head.lstrip()[:14].lower() in (b"<!doctype html", b"<html"),
    "glTF model": lambda head: head.startswith(b"glTF"),
}


#: How a file of a kind ends, where no other program could tell what it is.
_ENDINGS = {"page": (".html", ".htm"), "glTF model": (".glb",)}


def is_kind(path: Path, kind: str) -> bool:
    """Return whether a file is of a kind, by what it holds; an empty one may be replaced.

    Raises
    ------
    ResultsError
        If it is no regular file, or cannot be read.
    """
    try:
        head = read_regular(path, _HEAD)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read: {error.strerror}") from None
    return not head or _KINDS[kind](head)


def check_product(path: Path, kind: str, option: str = "-o") -> None:
    """Raise `ModelError` unless a product of this kind may be written there."""
    if path.is_dir():
        raise ModelError(f"{option} {path}: is a folder; give a file in it")
    endings = _ENDINGS.get(kind, ())
    if endings and path.suffix.lower() not in endings:
        raise ModelError(f"{option} {path}: a {kind}; the name must end in {' or '.join(endings)}")
    # a link that leads nowhere, or to itself, is replaced
    if path.exists() and not is_kind(path, kind):
        raise ModelError(f"{option} {path}: is there and is no {kind}; it is left alone")


def write_product(path: Path, data: bytes | str, kind: str, option: str = "-o") -> None:
    """Write a product as a whole: what is there stays where that fails.

    Raises
    ------
    ModelError
        If something of another kind is in the way.
    ResultsError
        If the file cannot be written.
    """
    check_product(path, kind, option)
    if isinstance(data, str):
        # names hold bytes that are no text
        data = data.encode("utf-8", "backslashreplace")
    replace_bytes(path, data, f"the {kind}")


def said_size(path: Path) -> str:
    """Return how large a product is."""
    return f"{os.stat(path).st_size / 1e6:.2f} MB"
