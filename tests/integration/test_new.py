"""First decks that `mbsim new` writes: they run as they are, and nothing is overwritten."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import mbsim
from mbsim.cli.main import main
from mbsim.cli.new import STARTERS


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize("kind", STARTERS)
def test_a_first_deck_has_no_fault_and_no_warning(tmp_path: Path, kind: str) -> None:
    written = call("new", kind, str(tmp_path / "mine"))
    assert written.exit_code == 0, written.output
    deck = tmp_path / "mine" / f"{kind}.xml"
    assert f"next: mbsim run {deck}" in written.stdout
    checked = call("check", str(deck))
    assert checked.exit_code == 0, checked.output
    assert "warning" not in checked.output
    assert f"mbsim run {kind}.xml" in deck.read_text("utf-8")


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "friction.py").write_text("mine")
    refused = call("new", "bowling", str(tmp_path))
    assert refused.exit_code == 2
    assert f"{tmp_path / 'friction.py'}: there already" in refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["friction.py"]
    (tmp_path / "file").write_text("")
    assert call("new", "stack", str(tmp_path / "file")).exit_code == 2


def test_half_a_deck_is_not_left_on_a_full_disk(tmp_path: Path, monkeypatch) -> None:
    whole = Path.open

    def full(path: Path, *mode: str, **how: str):
        if path.name == "friction.py":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return whole(path, *mode, **how)

    monkeypatch.setattr(Path, "open", full)
    failed = call("new", "bowling", str(tmp_path))
    assert failed.exit_code == 5
    assert "friction.py: the deck cannot be written: No space left on device" in failed.stderr
    assert not list(tmp_path.iterdir())


def test_the_mechanism_moves_as_its_comment_says(tmp_path: Path) -> None:
    call("new", "mechanism", str(tmp_path))
    with mbsim.simulate(tmp_path / "mechanism.xml", end_time=1.0) as results:
        x = results["bodies/4/position/x"]
    assert (x.min(), x.max()) == pytest.approx((0.2, 0.4), abs=1e-6)


def test_the_ball_rolls_as_its_comment_says(tmp_path: Path) -> None:
    call("new", "bowling", str(tmp_path))
    with mbsim.simulate(tmp_path / "bowling.xml", end_time=1.2) as results:
        assert results["bodies/2/velocity/x"][-1] == pytest.approx(25.0 / 7.0, abs=2e-3)
