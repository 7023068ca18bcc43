"""Problems in files: those of the repository, and those of the shared folder where it is there."""

from __future__ import annotations

from pathlib import Path

from helpers.folders import DATA, SHARED, data_file

NAMES = sorted({path.stem for top in (DATA, SHARED) for path in (top / "fclib").glob("*.hdf5")})


def problem_file(name: str) -> Path:
    """Return the file of a problem, or skip the test where it is absent."""
    return data_file(f"fclib/{name}.hdf5")
