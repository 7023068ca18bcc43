"""The benchmark as one page, and whole runs beside loops."""

from __future__ import annotations

import base64
import json
import sys

from click.testing import CliRunner

from mbsim.bench import front, whole
from mbsim.bench.measurement import Measurement
from mbsim.bench.page import page
from mbsim.bench.scenes import all_scenes
from mbsim.cli.main import main

#: One pixel.
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def row(engine, setting, wall, error, scene="S10a"):
    errors = {"rebound_error": error}
    return Measurement(scene, engine, "1", setting, 1, wall, wall, errors, {}, "")


def test_the_page_has_all_tables_and_pictures_in_itself(tmp_path):
    picture = tmp_path / "S10a.png"
    picture.write_bytes(PNG)
    text = "# Run time\n\nhere & now\n\n## S10a: a ball <1 kg\n\n| a | b |\n|---|---|\n| 1 | x |\n"
    made = page(text, {"S10a": picture})
    assert "here &amp; now" in made
    assert "<td>1</td>" in made
    assert f"data:image/png;base64,{base64.b64encode(PNG).decode()}" in made
    assert "a ball &lt;1 kg" in made
    assert 'src="S10a' not in made


def test_ours_and_the_best_peer_at_the_smallest_common_error_are_run_whole():
    scene = all_scenes()["S10a"]
    rows = [
        row("mbsim", "DOPRI5 tol=0.001", 1e-3, 1e-3),
        row("mbsim", "DOPRI5 tol=1e-05", 2e-3, 1e-5),
        row("mbsim", "DOP853 tol=1e-05", 3e-3, 1e-6),
        row("mujoco", "coarse", 1e-3, 5e-3),
        row("mujoco", "fine", 1e-2, 2e-5),
        row("mujoco", "finest", 1e-1, 1e-7),
    ]
    cells = front.compare(scene, rows)
    found = [(r.engine, r.setting) for r in whole.chosen([scene], rows, cells)]
    assert found == [("mbsim", "DOPRI5 tol=1e-05"), ("mujoco", "fine")]
    alone = whole.chosen([scene], rows[:3], [])
    assert [r.setting for r in alone] == ["DOPRI5 tol=0.001"]


def test_a_process_is_timed_and_its_memory_is_its_own():
    held = b"x" * 200_000_000
    code, wall, memory = whole._timed([sys.executable, "-c", "raise SystemExit(3)"])
    assert code == 3
    assert 0.0 < wall < 60.0
    assert memory is None or 1.0 < memory < len(held) / 1e6


def test_the_command_writes_page_and_whole_run(tmp_path):
    asked = ["bench", "S10a", "--no-peers", "--tol", "1e-3", "--integrator", "DOPRI5"]
    done = CliRunner().invoke(main, [*asked, "--repeats", "1", "-o", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    (run,) = told["whole_runs"]
    assert run["setting"].startswith("DOPRI5")
    assert run["note"] == ""
    assert run["whole_s"] > run["loop_s"]
    text = (tmp_path / "bench.html").read_text()
    assert "Whole runs" in text
    assert str(tmp_path / "bench.html") in told["files"]
