"""The compile policy: what makes compiled code stale."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from mbsim.core import jit

PACKAGE = Path(jit.__file__).resolve().parent.parent


def test_digest_follows_imports_through_files(tmp_path, monkeypatch):
    shutil.copytree(PACKAGE, tmp_path / "mbsim")
    package = tmp_path / "mbsim"
    script = (
        "from pathlib import Path; from mbsim.core import jit; "
        f"print(jit.source_digest([Path({str(package)!r}) / 'laws/normal/impact.py']), "
        f"jit.source_digest([Path({str(package)!r}) / 'laws/friction/coulomb.py']), "
        f"jit.source_digest([Path({str(package)!r}) / 'dynamics/pipeline/hooks.py']))"
    )

    def digests():
        done = subprocess.run(
            [sys.executable, "-c", script],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        )
        return done.stdout.split()

    before = digests()
    law = package / "laws/friction/coulomb.py"
    law.write_text(law.read_text() + "\n# edited\n")
    after_law = digests()
    # a law edit makes that law stale, and nothing else
    assert after_law[1] != before[1]
    assert [after_law[0], after_law[2]] == [before[0], before[2]]
    blend = package / "core/blend.py"
    blend.write_text(blend.read_text() + "\n# edited\n")
    after_helper = digests()
    # an edited helper makes every caller stale, also in other files
    assert after_helper[0] != after_law[0]
    assert after_helper[1] != after_law[1]


def test_cache_root_can_be_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MBSIM_CACHE_DIR", str(tmp_path))
    assert jit.cache_root() == tmp_path
    monkeypatch.delenv("MBSIM_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "x"))
    if sys.platform.startswith("linux"):
        assert jit.cache_root() == tmp_path / "x" / "mbsim"


def test_files_changed_meanwhile_are_neither_loaded_nor_stored(tmp_path):
    """An upgrade under a running process: what it imported before is not what they hold now."""
    shutil.copytree(PACKAGE, tmp_path / "mbsim")
    script = (
        "import sys; from pathlib import Path; "
        "from mbsim.core import jit; import mbsim.core.blend as blend; "
        f"law = Path({str(tmp_path / 'mbsim/core/blend.py')!r}); "
        "law.write_text(law.read_text() + '\\n#\\n') if sys.argv[1] == 'edit' else None; "
        "print(jit.function(blend.step)(0.5, 0.0, 0.0, 1.0, 1.0))"
    )

    def run(what):
        done = subprocess.run(
            [sys.executable, "-c", script, what],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            env={
                "PYTHONPATH": str(tmp_path),
                "PATH": "",
                "MBSIM_CACHE_DIR": str(tmp_path / "cache"),
            },
        )
        stored = {p for p in (tmp_path / "cache").rglob("*.nb?")}
        return done.stdout, stored

    value, stored = run("run")
    assert stored
    assert run("run") == (value, stored)
    assert run("edit") == (value, stored)
    # a process that begins later has the files as they are
    later, more = run("run")
    assert later == value
    assert more > stored


def test_what_is_only_counted_has_no_address_that_a_pair_remembers(monkeypatch):
    # MOREAU asks within `planned`, which counts first: -1 was kept, and called
    from mbsim.compile_model.contacts import near_address, pair_address
    from mbsim.geometry.catalog import PAIRS

    answers = iter([jit.NOT_YET, 4096, jit.NOT_YET, 8192])
    monkeypatch.setattr(jit, "address", lambda *arguments, **more: next(answers))
    assert [near_address("BOX-BOX", 12) for _ in range(2)] == [jit.NOT_YET, 4096]
    assert [pair_address(PAIRS["SPHERE-PLANE"]) for _ in range(2)] == [jit.NOT_YET, 8192]
