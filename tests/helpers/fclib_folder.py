"""Where the shared problems are, for the tests that use them."""

from __future__ import annotations

from pathlib import Path

import pytest

from helpers.folders import SHARED

FOLDER = SHARED / "fclib"
NAMES = sorted(path.stem for path in FOLDER.glob("*.hdf5"))


def problem_file(name: str) -> Path:
    """Return a file of the shared folder, or skip the test where it is absent."""
    path = FOLDER / f"{name}.hdf5"
    if not path.is_file():
        pytest.skip(f"{path} is not on this machine")
    return path
