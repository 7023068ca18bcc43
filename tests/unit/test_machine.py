"""Free memory is what a process may take, not what nobody has touched yet."""

from __future__ import annotations

from pathlib import Path

import pytest

from mbsim.core import machine


def test_memory_that_holds_files_counts_as_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "meminfo"
    told.write_text("MemTotal: 16000000 kB\nMemFree: 200000 kB\nMemAvailable: 12000000 kB\n")
    monkeypatch.setattr(machine, "_MEMINFO", told)
    assert machine.free_memory() == 12_000_000 * 1024


@pytest.mark.parametrize("text", ["", "MemFree: 5 kB\n", "MemAvailable: much\n", "MemAvailable:\n"])
def test_a_system_that_says_it_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    told = tmp_path / "meminfo"
    told.write_text(text)
    monkeypatch.setattr(machine, "_MEMINFO", told)
    found = machine.free_memory()
    assert found is None or found > 0
