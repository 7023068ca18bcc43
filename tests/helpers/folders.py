"""Folders of the checkout, and data that lie above it, shared by several checkouts."""

from __future__ import annotations

from pathlib import Path

import pytest

import mbsim

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
DATA = TESTS / "data"
MODELS = ROOT / "models"
CORPUS = TESTS / "corpus"
USERFUNCS = ROOT / "userfuncs"
#: Where processes of their own find the package under test.
PACKAGES = Path(mbsim.__file__).resolve().parents[1]
#: More of what is in DATA; it need not be there.
SHARED = next(
    (data for folder in ROOT.parents if (data := folder / "shared" / "data").is_dir()),
    ROOT.parent / "shared" / "data",
)


def data_file(path: str) -> Path:
    """Return a file of DATA, or of SHARED, or skip the test where neither has it."""
    for folder in (DATA, SHARED):
        if (folder / path).is_file():
            return folder / path
    pytest.skip(f"{path} is neither in {DATA} nor in {SHARED}")
