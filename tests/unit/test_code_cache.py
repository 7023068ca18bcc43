"""The folder of compiled code: made for the user alone, refused where others could put code."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

import pytest
from numba.core.caching import IndexDataCacheFile

from mbsim.core import code_cache, jit
from mbsim.errors import ModelError

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners of POSIX systems")


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder that code is to be kept in, and that is not there yet."""
    monkeypatch.setenv("MBSIM_CACHE_DIR", str(tmp_path / "code"))
    code_cache.trusted_root.cache_clear()
    monkeypatch.setattr(code_cache, "_unkept", set())
    return tmp_path / "code"


@pytest.fixture(autouse=True)
def _forgotten() -> object:
    """Forget what was found out of a test's folder."""
    yield
    code_cache.trusted_root.cache_clear()


def double(x: float) -> float:
    """Twice x."""
    return 2.0 * x


def half(x: float) -> float:
    """A half of x."""
    return x / 2.0


def third(x: float) -> float:
    """A third of x."""
    return x / 3.0


def compiled() -> float:
    """Compile something and keep it."""
    return float(jit.function(double)(3.0))


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_it_is_made_for_the_user_alone(root: Path) -> None:
    before = os.umask(0)
    try:
        assert code_cache.trusted_root() == root
        sources = code_cache.Sources(double)
        sources.make_folder()
    finally:
        os.umask(before)
    for folder in (root, *root.rglob("*")):
        assert mode(folder) == 0o700


@pytest.mark.parametrize("bits", [0o720, 0o702, 0o777, 0o1777])
def test_one_that_others_can_write_is_refused(root: Path, bits: int) -> None:
    root.mkdir()
    root.chmod(bits)
    with pytest.raises(ModelError, match=r"can be written by others.*chmod go-w .*MBSIM_CACHE_DIR"):
        code_cache.trusted_root()


def test_a_folder_within_that_others_can_write_is_refused(root: Path) -> None:
    sources = code_cache.Sources(double)
    sources.make_folder()
    sources.folder.chmod(0o770)
    with pytest.raises(ModelError, match="can be written by others"):
        sources.make_folder()


@pytest.mark.skipif(
    os.name != "posix" or os.geteuid() != 0, reason="gives a folder away: root only"
)
def test_another_users_is_refused(root: Path) -> None:
    root.mkdir(mode=0o700)
    os.chown(root, 12345, -1)
    with pytest.raises(ModelError, match="belongs to another user"):
        code_cache.trusted_root()


def test_one_that_cannot_be_made_is_told_once(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root.write_text("a file stands there")
    assert compiled() == 6.0
    code_cache.trusted_root()
    said = [line for line in capsys.readouterr().err.splitlines() if "not kept" in line]
    assert len(said) == 1
    assert str(root) in said[0]


def test_a_full_one_is_told_once(
    root: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is there, but no file can be written in it."""
    root.mkdir(mode=0o700)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    monkeypatch.setattr(jit, "is_known", lambda function: True)
    assert [jit.function(function)(3.0) for function in (half, third)] == [1.5, 1.0]
    said = [line for line in capsys.readouterr().err.splitlines() if "not kept" in line]
    assert len(said) == 1
    assert "No space left on device" in said[0]
