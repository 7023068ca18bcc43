"""Folders of the checkout, and data that lie above it, shared by several checkouts."""

from __future__ import annotations

from pathlib import Path

import mbsim

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
MODELS = ROOT / "models"
USERFUNCS = ROOT / "userfuncs"
#: Where processes of their own find the package under test.
PACKAGES = Path(mbsim.__file__).resolve().parents[1]
#: It need not be there.
SHARED = next(
    (data for folder in ROOT.parents if (data := folder / "shared" / "data").is_dir()),
    ROOT.parent / "shared" / "data",
)
