"""Building shared libraries for tests, with the commands that the example sources name."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from helpers.folders import USERFUNCS


def need(program):
    """Skip a test that needs a program which this machine has not."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")


def compiled(folder, text, language="c", name="user"):
    """Return a library made of source text: language c or f90."""
    program = {"c": "gcc", "f90": "gfortran"}[language]
    need(program)
    source, library = Path(folder) / f"{name}.{language}", Path(folder) / f"{name}.so"
    source.write_text(text, encoding="utf-8")
    command = [program, "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return library


def example(folder, name):
    """Return the library of an example of userfuncs/, by the Linux command on its top."""
    source = USERFUNCS / name
    line = re.search(r"Linux:\s+(.*)", source.read_text(encoding="utf-8")).group(1).split()
    need(line[0])
    shutil.copy(source, folder)
    subprocess.run(line, check=True, capture_output=True, cwd=folder)
    return Path(folder) / line[line.index("-o") + 1]
