"""Packed surfaces that are kept: in this process, and in the cache folder for later ones.

To pack a mesh of 10,000 triangles takes a second; a sweep would do so for each of its runs. The
smallest gain as well: a box is packed in a tenth of a second with a layer and in milliseconds
without, and read in a tenth of one (tests/bench/mesh_packing.py). A file is named after the mesh
and after the project files that pack it, and holds a digest of itself: what is damaged, of another
version or written by a process whose files were changed meanwhile is packed anew.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import tempfile
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mbsim.core.code_cache import Sources, check_trusted, trusted_root
from mbsim.core.stored import read_regular
from mbsim.errors import ModelError
from mbsim.model.elements import Array
from mbsim.model.mesh import Faces
from mbsim.model.packing import pack_mesh

#: Numbers that a process keeps at most: those that were asked for last.
MOST_NUMBERS = 16_000_000
#: Bytes of all files at most; those that were asked for last stay.
MOST_BYTES = 2**29
#: Bytes that a file counts for at least, so that the folder is soon looked through: 2048 files.
LEAST_BYTES = 2**18

_here: OrderedDict[str, Array] = OrderedDict()


def kept_surface(vertices: Array, faces: Faces, layered: bool) -> Array:
    """Return what `pack_mesh` makes of a mesh, made once; not to be written to."""
    digest = hashlib.sha256(f"{vertices.shape} {faces.shape} {layered}".encode())
    digest.update(np.ascontiguousarray(vertices, dtype="<f8").data)
    digest.update(np.ascontiguousarray(faces, dtype="<i8").data)
    name = digest.hexdigest()
    found = _here.pop(name, None)
    if found is None:
        make = functools.partial(pack_mesh, vertices, faces, layered)
        found = _in_files(name, make)
        found.flags.writeable = False
    _here[name] = found
    while sum(map(len, _here.values())) > MOST_NUMBERS:
        _here.popitem(last=False)
    return found


def forget() -> None:
    """Forget what this process has kept; files stay."""
    _here.clear()


@functools.cache
def _sources() -> Sources:
    """Return the project files that packed surfaces follow from."""
    return Sources(pack_mesh)


def _in_files(name: str, make: Callable[[], Array]) -> Array:
    """Return what stands in the file of this name, or else what `make` does, and write that."""
    sources = _sources()
    if sources.changed():
        return make()
    try:
        folder = trusted_root() / "surfaces"
        check_trusted(folder)
    except ModelError:
        return make()
    path = folder / f"{name[:32]}-{sources.digest}-{np.__version__}"
    found = _read(path)
    if found is None:
        found = make()
        if not sources.changed_by_now():
            # without room or rights the run goes on: it has what it needs
            with contextlib.suppress(OSError):
                _write(path, found)
    return found


def _read(path: Path) -> Array | None:
    """Return what a file holds; None if it is not there, or damaged."""
    try:
        text = read_regular(path)
        os.utime(path)
    except OSError:
        return None
    mark, numbers = text[:32], text[32:]
    if len(numbers) % 8 != 0 or hashlib.sha256(numbers).digest() != mark:
        return None
    return np.frombuffer(numbers, dtype="<f8").astype(np.float64)


def _write(path: Path, packed: Array) -> None:
    """Write a file whole or not at all, and remove those that were not asked for longest.

    One that alone is larger than all may be is not written: it would cost all others.
    """
    numbers = packed.astype("<f8").tobytes()
    if len(numbers) > MOST_BYTES:
        return
    folder = path.parent
    folder.mkdir(mode=0o700, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=folder)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(numbers).digest() + numbers)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    _remove_oldest(path)


def _remove_oldest(latest: Path) -> None:
    """Remove the files beside `latest` that were not asked for longest, down to `MOST_BYTES`."""
    with os.scandir(latest.parent) as entries:
        stats = [(entry.stat(), entry) for entry in entries]
    files = [(stat.st_mtime, max(stat.st_size, LEAST_BYTES), entry) for stat, entry in stats]
    total = sum(size for _, size, _ in files)
    if total <= MOST_BYTES:
        return
    for _, size, entry in sorted(files, key=lambda one: one[0]):
        if total <= MOST_BYTES:
            break
        if entry.name != latest.name:
            with contextlib.suppress(OSError):
                os.unlink(entry.path)
                total -= size
