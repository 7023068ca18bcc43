"""Runs that are killed at random instants go on as if nothing had been, bit for bit.

``MBSIM_KILLS=200 python -m pytest -m slow -s tests/integration/test_kills.py`` kills so many; a
quarter as many are stopped by SIGTERM, SIGHUP or SIGINT, a tenth run out of disk. What they found
out is printed.
"""

from __future__ import annotations

import functools
import os
import random
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from helpers.ends import (
    Changes,
    can_go_on,
    command,
    hidden,
    looked_at,
    resized,
    run_beside,
    run_until,
    same,
    small_disk,
    visible,
)
from helpers.kill_decks import CASES
from mbsim.results.reading import open_results
from mbsim.results.recorder import BUFFER_BYTES

KILLS = int(os.environ.get("MBSIM_KILLS", "25"))
SEED = int(os.environ.get("MBSIM_KILL_SEED", "1"))
LINUX = sys.platform == "linux"


class Straight:
    """A run that nothing ends, and how long it takes."""

    def __init__(self, folder: Path, case: str) -> None:
        self.deck, self.options = CASES[case](folder)
        self.out = folder / "straight"
        self.whole = self._timed()
        with open_results(next(self.out.glob("*.h5"))) as results:
            compiled = results.stats["compile_s"]
            #: Seconds of its loop alone.
            self.loop = results.stats["loop_s"]
            #: Bytes of its signals.
            self.size = size = sum(results[name].nbytes for name in results.signals())
        #: How many writes there are until a run is killed; of a long one blocks are on their way.
        self.writes = [20, 40] + [150, 300, 600, 1200] * (size > 2 * BUFFER_BYTES)
        if compiled > 0.1 * self.whole:
            self.whole = self._timed()

    def _timed(self) -> float:
        """Run once, and return the seconds that it took."""
        began = time.perf_counter()
        code, said = run_until(self.line(self.out))
        assert code == 0, said
        return time.perf_counter() - began

    def line(self, out: Path, *more: str) -> list[str]:
        """Return the command line of such a run into another folder."""
        return command(self.deck, self.options, out, *more)

    def resume(self, out: Path) -> None:
        """Let an ended run go on to its end, and compare."""
        more = ["--resume"] if can_go_on(out) else []
        code, said = run_until(self.line(out, *more))
        assert code == 0, said
        self.is_like(out)
        assert not hidden(out)

    def is_like(self, out: Path) -> None:
        """Compare with another run that has finished."""
        same(self.out, out)
        assert visible(out) == visible(self.out)


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Straight]:
    """Return what runs a case straight, once for all tests."""

    @functools.cache
    def made(case: str) -> Straight:
        return Straight(tmp_path_factory.mktemp("straight"), case)

    return made


def share(total: int, case: str) -> int:
    """Return how many of so many ends a case has."""
    k = list(CASES).index(case)
    return total * (k + 1) // len(CASES) - total * k // len(CASES)


def of_cases(total: int) -> list[str]:
    """Return the cases that have some."""
    return [case for case in CASES if share(total, case)]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
@pytest.mark.parametrize("case", of_cases(KILLS))
def test_a_killed_run_goes_on_bit_for_bit(
    tmp_path: Path, straight: Callable[[str], Straight], case: str
) -> None:
    """Killed at any instant, or at any change of its files; so is the run that goes on."""
    whole, chance = straight(case), random.Random(f"{SEED} {case}")
    kills = resumed = round_ = 0
    while kills < share(KILLS, case):
        out, more, status = tmp_path / f"killed{round_}", [], ""
        round_ += 1
        while status != "finished" and kills < share(KILLS, case):
            how = chance.choice(["time", "names", "bytes", "result"]) if LINUX else "time"
            after, at = chance.uniform(0.0, whole.whole), None
            changes = None if how == "time" else Changes(out, with_bytes=how == "bytes")
            if how == "result":
                after *= 0.25  # as long as runs take after their first flush
            elif how != "time":
                at = chance.choice([1, 2, 3, 5, 8, 12] + whole.writes * (how == "bytes"))
            code, said = run_until(whole.line(out, *more), after, changes=changes, at=at)
            if changes is not None:
                changes.close()
            assert code in (0, -signal.SIGKILL), said
            kills += code != 0
            resumed += bool(more)
            status = looked_at(out) if out.exists() else ""
            assert status in ("", "running", "finished")
            more = ["--resume"] if status else []
        if status == "finished":
            whole.is_like(out)
        else:
            resumed += bool(more)
            whole.resume(out)
    print(f"{case}: {kills} kills, {resumed} resumed, {round_} runs of {whole.whole:.1f} s")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_a_run_killed_while_it_compiles(
    tmp_path: Path, straight: Callable[[str], Straight], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it leaves in the cache does not harm the next one, nor a result that is there."""
    whole, chance = straight("walls"), random.Random(f"{SEED} compile")
    out = tmp_path / "out"
    shutil.copytree(whole.out, out)
    monkeypatch.setenv("MBSIM_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MBSIM_SHIPPED_CODE", "")
    for _ in range(max(2, KILLS // 40)):
        code, _ = run_until(whole.line(out), chance.uniform(0.5, 4.0) * whole.whole)
        if code == 0:
            break
        assert looked_at(out) in ("finished", "running")
    whole.resume(out)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize("case", of_cases(KILLS // 4))
def test_a_stopped_run_goes_on_bit_for_bit(
    tmp_path: Path, straight: Callable[[str], Straight], case: str
) -> None:
    whole, chance = straight(case), random.Random(f"{SEED} stop {case}")
    codes = []
    for k in range(share(KILLS // 4, case)):
        out = tmp_path / f"stopped{k}"
        number = chance.choice([signal.SIGTERM] * 4 + [signal.SIGHUP, signal.SIGINT])
        # most of the time passes before a run begins, which its first result shows
        changes = Changes(out, with_bytes=False) if LINUX and chance.random() < 0.8 else None
        after = chance.uniform(0.4, 1.05) * whole.whole
        if changes is not None:
            after = chance.uniform(0.0, 0.9) * whole.loop
        code, said = run_until(whole.line(out), after, number, changes)
        if changes is not None:
            changes.close()
        codes.append(code)
        # before the run begins nothing is there to be kept
        assert code in (0, -number, 128 + number), said
        assert "Traceback" not in said
        status = looked_at(out) if out.exists() else ""
        if code == 0 or status == "finished":
            whole.is_like(out)
            continue
        assert status == ("interrupted" if "kept in" in said else "")
        whole.resume(out)
    print(f"{case}: stopped with codes {codes}, {whole.whole:.1f} s a run")


@pytest.mark.slow
@pytest.mark.skipif(not LINUX or os.geteuid() != 0, reason="mounts small disks")
@pytest.mark.parametrize("case", of_cases(KILLS // 10))
def test_a_run_on_a_full_disk_goes_on_when_there_is_room(
    tmp_path: Path, straight: Callable[[str], Straight], case: str
) -> None:
    whole, chance = straight(case), random.Random(f"{SEED} disk {case}")
    size = sum(path.stat().st_size for path in whole.out.iterdir()) / 2**20
    for k in range(share(KILLS // 10, case)):
        # its rows just fit, or nothing does once there is a result
        beside = chance.random() < 0.7
        room = 10.0 + 5.0 * size if beside else 0.3 + chance.uniform(0.8, 2.0) * size
        with small_disk(tmp_path / f"disk{k}", room) as disk:
            out, ballast = disk / "out", disk / "ballast"
            if beside:
                left = int(chance.choice([0.0, 0.1, 0.3, 1.0]) * 2**20)
                code, said = run_beside(whole.line(out), out, ballast, left)
                ballast.unlink()
            else:
                code, said = run_until(whole.line(out))
            status = looked_at(out) if out.exists() else ""
            how = "with a checkpoint" if status and can_go_on(out) else "without"
            print(f"{case}: {room:.1f} of {size:.1f} MB: {code}, {status or 'nothing'} {how}")
            if code == 0:
                whole.is_like(out)
                continue
            assert "Traceback" not in said
            assert code in (2, 5), said
            # what is refused ahead counts all bytes of rows, however well they are packed
            resized(disk, f"size={int(10 * size + 1.3e-6 * whole.size + 10)}m")
            whole.resume(out)
