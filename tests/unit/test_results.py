"""Result files: what they hold, that they survive, and that they can be gone on with."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.fake_run import REQUEST, SETTINGS, add_rows, checkpoint, fake_system, fake_system_of
from helpers.folders import PACKAGES, TESTS
from helpers.minimal_deck import added
from mbsim.arrays import codes
from mbsim.errors import ModelError, ResultsError, UnknownSignal
from mbsim.results import recorder as recorder_module
from mbsim.results.form import finite
from mbsim.results.log import MOST_LINES, RunLog
from mbsim.results.reading import Results, open_results
from mbsim.results.recorder import Recorder
from mbsim.results.store import Store
from mbsim.results.watch import Watch

STATS = {"steps": 12, "wall_s": 0.5}


def recorded(folder: Path, rows: int = 10, status: str = "finished") -> Results:
    """Return the results of a fake run."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    add_rows(system, 0, rows)
    recorder.take()
    system.scene.log.contacts[0, codes.PEAK_FORCE] = 77.0
    return recorder.close(status, STATS, system.scene.log.contacts)


def run_fake(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the fake in a process of its own."""
    path = os.pathsep.join([str(PACKAGES), str(TESTS)])
    return subprocess.run(
        [sys.executable, "-m", "helpers.fake_run", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        check=False,
    )


def test_signals(tmp_path: Path) -> None:
    with recorded(tmp_path) as results:
        k = np.arange(10)
        np.testing.assert_array_equal(results["time"], 0.1 * k)
        np.testing.assert_array_equal(results["bodies/2/position/x"], k)
        assert results["bodies/2/position"].shape == (10, 3)
        np.testing.assert_array_equal(results["/bodies/2/quaternion"][:, 0], np.ones(10))
        np.testing.assert_array_equal(results["bodies/2/acceleration"][3], [3, 3, 3])
        np.testing.assert_array_equal(results["contacts/301/force"][2], [200, 201, 202])
        np.testing.assert_array_equal(results["contacts/301/torque"][2], [203, 204, 205])
        assert results["contacts/301/penetration"][2] == 206
        assert results["contacts/301/slip_speed"][2] == 207
        assert results["contacts/301/incidents"].dtype == np.int64
        assert results["contacts/301/area"][2] == 209
        np.testing.assert_array_equal(results["energy/dissipated"], 3 * k)
        np.testing.assert_array_equal(results["state/y"][:, 0], k)
        assert results["contacts/301/peak_force"] == 77.0
        assert results["requests/7"].shape == (10, 8)
        np.testing.assert_array_equal(results["requests/7/F2"], k)
        assert results.stats == STATS
        assert results.attributes["status"] == results.status == "finished"
        assert results.attributes["tol"] == 1e-5
        assert "state/y" in results.keys()
        assert "bodies/2/position/mag" in results
        assert "bodies/2/position/w" not in results
        # 2 before 10, and every name leads somewhere
        for name in results.keys():
            assert results[name] is not None


def test_incident_offsets_and_events(tmp_path: Path) -> None:
    with recorded(tmp_path) as results:
        offsets = results["state/incident_offsets"]
        np.testing.assert_array_equal(np.diff(offsets), np.arange(10) % 2)
        assert results["state/incidents"][offsets[3], 0] == 3
        events = results["events"]
        assert list(events["kind"]) == ["touch", "leave"]
        assert list(events["element"]) == [301, 301]
        assert events["time"][0] == pytest.approx(0.01)


def test_angular_velocity_is_global(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, None)
    add_rows(system, 0, 1)
    # a quarter turn about x takes the body's z to -y
    system.scene.rows.y[0, 3:7] = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    recorder.take()
    results = recorder.close("finished", STATS, system.scene.log.contacts)
    np.testing.assert_allclose(results["bodies/2/angular_velocity"][0], [0, -0.5, 0], atol=1e-15)


def test_many_writes_give_the_file_of_one(tmp_path: Path, monkeypatch: Any) -> None:
    with recorded(tmp_path / "one", 60) as whole:
        monkeypatch.setattr(recorder_module, "BUFFER_BYTES", 2000)
        monkeypatch.setattr(recorder_module, "FEWEST_ROWS", 1)
        system = fake_system(tmp_path / "deck")
        recorder = Recorder(system, SETTINGS, tmp_path / "many")
        for first in range(0, 60, 10):
            add_rows(system, first, 10, events=first == 0)
            recorder.take()
            assert recorder._gathered.bytes <= 2000
            recorder.flush(checkpoint(first + 10))
        with recorder.close("finished", STATS, system.scene.log.contacts) as parts:
            for name in whole.keys():
                if "peak" not in name:
                    np.testing.assert_array_equal(whole[name], parts[name], err_msg=name)
            assert not parts.has_checkpoint


def test_take_empties_the_rows(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 5)
    recorder.take()
    assert list(system.scene.rows.used) == [0, 0, 0]
    assert not recorder.due()
    recorder.close("finished", STATS, system.scene.log.contacts).close()
    np.testing.assert_array_equal(recorder.watch.first, [0, 0, 0, 0])
    np.testing.assert_array_equal(recorder.watch.last, [4, 8, 12, 16])


def test_run_without_rows_is_complete(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    recorder.flush(checkpoint(0))
    with recorder.close("failed", STATS, system.scene.log.contacts) as results:
        assert results["bodies/2/position"].shape == (0, 3)
        assert len(results["events"]) == 0
        assert list(results["state/incident_offsets"]) == [0]


def test_in_memory_leaves_no_file(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, None)
    add_rows(system, 0, 5)
    recorder.take()
    recorder.flush(checkpoint(5))
    results = recorder.close("finished", STATS, system.scene.log.contacts)
    assert results["time"].shape == (5,)
    assert results.path is None
    assert [path.name for path in tmp_path.iterdir()] == ["deck"]
    results.close()
    with pytest.raises(ResultsError, match="closed"):
        results["time"]


def test_csv_reads_back_exactly(tmp_path: Path) -> None:
    with recorded(tmp_path) as results:
        lines = (tmp_path / "deck.csv").read_text().splitlines()
        assert lines[0].split(",")[:3] == ["Time", "7.F1", "7.F2"]
        table = np.array([[float(word) for word in line.split(",")] for line in lines[1:]])
        np.testing.assert_array_equal(table[:, 0], results["time"])
        np.testing.assert_array_equal(table[:, 1:], results["requests/7"])


def test_no_request_no_csv(tmp_path: Path) -> None:
    (tmp_path / "deck.csv").write_text("of another run")
    system = fake_system(tmp_path / "deck", "")
    Recorder(system, SETTINGS, tmp_path).close("finished", STATS, system.scene.log.contacts)
    assert not (tmp_path / "deck.csv").exists()


def test_close_leaves_only_results(tmp_path: Path) -> None:
    recorded(tmp_path).close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deck", "deck.csv", "deck.h5"]


# --- crashes ---------------------------------------------------------------------------------


def test_killed_between_flushes(tmp_path: Path) -> None:
    assert run_fake("die", str(tmp_path)).returncode == -9
    assert (tmp_path / ".deck.h5.part").exists()
    with open_results(tmp_path / "deck.h5") as results:
        assert results.status == "running"
        np.testing.assert_array_equal(results["bodies/2/position/x"], np.arange(10))
        assert results.tables("checkpoint")["stage"] == 10
        # what plot labels curves with
        assert results.attribute("requests/7", "type") == "MARKER_DISPLACEMENT"
        assert results.label("requests/7") == "ball"

    # and the run can go on, right after the rows that belong to the checkpoint
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path, resume=True)
    assert recorder.checkpoint["stage"] == 10
    np.testing.assert_array_equal(recorder.checkpoint["method/y"], np.full(4, 10.0))
    assert recorder.checkpoint["state/none"].shape == (0, 3)
    add_rows(system, 10, 5)
    recorder.take()
    with recorder.close("finished", STATS, system.scene.log.contacts) as results:
        np.testing.assert_array_equal(results["bodies/2/position/x"], np.arange(15))
        offsets = results["state/incident_offsets"]
        np.testing.assert_array_equal(np.diff(offsets), np.arange(15) % 2)
        assert results["state/incidents"][offsets[13], 0] == 13
        assert results["requests/7"].shape == (15, 8)
        assert len(results["events"]) == 6
    assert not (tmp_path / ".deck.h5.part").exists()


def test_killed_run_leaves_the_earlier_result(tmp_path: Path) -> None:
    recorded(tmp_path).close()
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 3)
    recorder.take()
    with open_results(tmp_path / "deck.h5") as results:
        assert results.status == "finished"
        assert len(results["time"]) == 10
    recorder._store.abandon()


@pytest.mark.skipif(sys.platform == "win32", reason="needs setrlimit")
@pytest.mark.parametrize("limit", [150_000, 400_000])
def test_full_disk(tmp_path: Path, limit: int) -> None:
    done = run_fake("fill", str(tmp_path), str(limit))
    assert done.returncode == 5, done.stderr
    assert "deck.h5: results cannot be written" in done.stdout
    assert len(done.stdout.splitlines()) == 1
    assert "Traceback" not in done.stderr
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    with open_results(tmp_path / "deck.h5") as results:
        rows = len(results["time"])
        assert rows == 10 or results.tables("checkpoint")["stage"] * 60 + 70 == rows


def test_two_runs_in_one_folder(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    system = fake_system(tmp_path / "deck")
    first = Recorder(system, SETTINGS, tmp_path)
    with pytest.raises(ResultsError, match="another run"):
        Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 3)
    first.take()
    with first.close("finished", STATS, system.scene.log.contacts) as results:
        assert len(results["time"]) == 3


# --- where results cannot go -----------------------------------------------------------------


def test_folder_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(ResultsError, match="is a file") as raised:
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path / "out")
    assert raised.value.exit_code == 5
    with pytest.raises(ResultsError, match="out"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path / "out" / "below")


def test_result_name_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "deck.h5").mkdir()
    with pytest.raises(ResultsError, match="is a folder"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write anywhere")
def test_folder_is_protected(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir(mode=0o500)
    with pytest.raises(ResultsError, match="denied"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path / "out")


def test_folder_disappears(tmp_path: Path) -> None:
    out = tmp_path / "out"
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, out)
    add_rows(system, 0, 3)
    recorder.take()
    shutil.rmtree(out)
    with pytest.raises(ResultsError, match="cannot be written"):
        recorder.flush(checkpoint(3))
    recorder.take()
    recorder.flush(checkpoint(3))
    # the caller's clean-up tells the same story
    with pytest.raises(ResultsError, match="cannot be written"):
        recorder.close("failed", STATS, system.scene.log.contacts)


# --- resume ----------------------------------------------------------------------------------


def interrupted(folder: Path) -> None:
    """Leave an interrupted run."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    add_rows(system, 0, 5)
    recorder.take()
    recorder.flush(checkpoint(5))
    recorder.close("interrupted", STATS, system.scene.log.contacts).close()


def test_resume_of_an_interrupted_run(tmp_path: Path) -> None:
    interrupted(tmp_path)
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path, resume=True)
    add_rows(system, 5, 5)
    recorder.take()
    recorder.flush(checkpoint(10))
    recorder.close("interrupted", STATS, system.scene.log.contacts).close()
    with open_results(tmp_path / "deck.h5") as results:
        np.testing.assert_array_equal(results["bodies/2/position/x"], np.arange(10))
        assert results.status == "interrupted"
        assert results.tables("checkpoint")["stage"] == 10


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tol": 1e-6}, "tol was 1e-05 and is 1e-06 now"),
        ({"model_sha256": "def"}, "the model file has changed"),
        ({"detector": "fcl"}, "detector was not given and is fcl now"),
    ],
)
def test_resume_with_other_settings(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    interrupted(tmp_path)
    with pytest.raises(ModelError, match=said) as raised:
        Recorder(fake_system(tmp_path / "deck"), {**SETTINGS, **change}, tmp_path, resume=True)
    assert "\n" not in str(raised.value)
    assert not (tmp_path / ".deck.h5.part").exists()


def test_resume_with_another_friction(tmp_path: Path) -> None:
    interrupted(tmp_path)
    model = fake_system(tmp_path / "deck").model
    contact = replace(model.contacts[301], mu_static=0.9)
    system = fake_system_of(replace(model, contacts={301: contact}))
    with pytest.raises(
        ModelError, match=r"--set.*Force_Contact\[301\].mu_static was .* is 0.9 now"
    ):
        Recorder(system, SETTINGS, tmp_path, resume=True)


def test_resume_without_anything(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    with pytest.raises(ModelError, match="no such file"):
        Recorder(system, SETTINGS, tmp_path, resume=True)
    with pytest.raises(ModelError, match="no folder"):
        Recorder(system, SETTINGS, None, resume=True)
    recorded(tmp_path).close()
    with pytest.raises(ModelError, match="has finished"):
        Recorder(system, SETTINGS, tmp_path, resume=True)
    recorded(tmp_path, status="failed").close()
    with pytest.raises(ModelError, match="no checkpoint"):
        Recorder(system, SETTINGS, tmp_path, resume=True)
    (tmp_path / "deck.h5").write_text("not HDF5")
    with pytest.raises(ModelError, match="not an HDF5 file"):
        Recorder(system, SETTINGS, tmp_path, resume=True)


# --- reading ---------------------------------------------------------------------------------


def test_missing_names(tmp_path: Path) -> None:
    with recorded(tmp_path) as results:
        with pytest.raises(ResultsError, match="did you mean bodies/2/position"):
            results["bodies/2/postion"]
        assert "peak_" in " ".join(results.keys())
        with pytest.raises(UnknownSignal) as missing:
            results.find("contacts/301/peak_forces")
        assert "contacts/301/peak_" not in str(missing.value).partition("did you mean")[2]
        with pytest.raises(ResultsError, match=r"is a group.*acceleration"):
            results["bodies/2"]
        with pytest.raises(ResultsError, match=r"are for mbsim request"):
            results["Force_Contact[301].force"]
        for name in ("", "/", "nothing/like/it", "time/x", "bodies/2/position/y/z"):
            with pytest.raises(ResultsError):
                results[name]


def test_find_resolves_names_as_reading_does(tmp_path: Path) -> None:
    with recorded(tmp_path) as results:
        assert results.find("/bodies/2/position/") == ["bodies/2/position"]
        for name in results.find("bodies/*/*/*") + results.find("requests/7/*"):
            assert results[name].shape == results["time"].shape
        assert results.find("energy/[kp]*") == ["energy/kinetic", "energy/potential"]
        assert results.signals()["bodies/2/quaternion"] == 4
        for name in ("bodies/*", "events", "state/y", "contacts/301/peak_force", ""):
            with pytest.raises(UnknownSignal) as raised:
                results.find(name)
            assert raised.value.exit_code == 2


def test_bad_files(tmp_path: Path) -> None:
    import h5py

    with pytest.raises(ResultsError, match="no such file"):
        open_results(tmp_path / "none.h5")
    with pytest.raises(ResultsError, match="is a folder"):
        open_results(tmp_path)
    (tmp_path / "text.h5").write_text("text")
    with pytest.raises(ResultsError, match="not an HDF5 file"):
        open_results(tmp_path / "text.h5")
    h5py.File(tmp_path / "other.h5", "w").close()
    with pytest.raises(ResultsError, match="not a result file"):
        open_results(tmp_path / "other.h5")


def test_a_truncated_file_is_one_message(tmp_path: Path) -> None:
    recorded(tmp_path).close()
    data = (tmp_path / "deck.h5").read_bytes()
    (tmp_path / "deck.h5").write_bytes(data[: len(data) // 2])
    with pytest.raises(ResultsError, match=r"deck\.h5"):
        open_results(tmp_path / "deck.h5")


def test_finite_is_json() -> None:
    value = {"a": float("inf"), 2: [np.float64("nan"), np.int64(3)], "c": np.zeros(2)}
    assert finite(value) == {"a": None, "2": [None, 3], "c": [0.0, 0.0]}


def test_failed_constructor_releases_its_lock(tmp_path: Path, monkeypatch: Any) -> None:
    import h5py

    def refuse(*args: Any, **options: Any) -> None:
        raise OSError("no")

    with monkeypatch.context() as patch:
        patch.setattr(h5py, "File", refuse)
        with pytest.raises(ResultsError):
            Store(tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []
    Store(tmp_path / "a.h5").abandon()


# --- log -------------------------------------------------------------------------------------


def test_log(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    log = RunLog(system, SETTINGS, tmp_path)
    log.line("USRMES:USER [1] INFO: hello")
    row = system.scene.log.contacts[0]
    row[:] = np.nan
    row[[codes.TOUCHES, codes.PEAK_FORCE, codes.FIRST_TOUCH]] = 2, 1234.5, 0.25
    system.scene.log.rejections[0, codes.REJECT_DEPTH] = 4
    watch = Watch([])
    watch.add(np.array([0.0, 1.0]), np.array([[4.0, 1, 0, 0], [1, 2, 3, 0]]), np.zeros((2, 0)))
    log.close("finished", {"steps": 12, "wall_s": 0.5}, watch)
    text = (tmp_path / "deck.log").read_text()
    facts = [" ".join(line.split()) for line in text.splitlines()]
    for said in (
        "units NEWTON KILOGRAM METER SECOND",
        "normal law IMPACT, built in",
        "stiffness 1e+08",
        "friction law COULOMB_ON, built in",
        "mu_static 0.3",
        "mu_dynamic 0.2",
        "stiction_trans_vel 0.01",
        "friction_trans_vel 0.02",
        "pair Post_Graphic[200] Post_Graphic[100]: closed form SPHERE-PLANE",
        "USRMES:USER [1] INFO: hello",
        "largest force 1234.5",
        "first touch at time 0.25",
        "effective rebound, first impact -",
        "Force_Contact[301] 4 impact would begin too deep",
        "dissipated total 3",
        "balance, change since the start 1",
        "of kinetic + potential + dissipated",
        "steps 12",
        "wall_s 0.500",
    ):
        assert said in facts, f"{said!r} is not in\n{text}"
    assert facts[-1] == "wall_s 0.500"


def test_log_is_the_same_twice(tmp_path: Path) -> None:
    texts = []
    for name in ("a", "b"):
        log = RunLog(fake_system(tmp_path / "deck"), SETTINGS, tmp_path / name)
        (tmp_path / name).mkdir()
        log.close("finished", {"steps": 1})
        texts.append((tmp_path / name / "deck.log").read_text())
    assert texts[0] == texts[1]


def test_log_of_a_resumed_run_goes_on(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    log = RunLog(system, SETTINGS, tmp_path)
    log.line("before")
    log.close("interrupted", {})
    again = RunLog(system, SETTINGS, tmp_path, resume=True)
    again.close("finished", {})
    text = (tmp_path / "deck.log").read_text()
    assert text.index("before") < text.index("resumed from the last") < text.index("end: finished")


def test_a_talkative_subroutine_does_not_fill_memory(tmp_path: Path) -> None:
    log = RunLog(fake_system(tmp_path / "deck"), SETTINGS, None)
    for _ in range(MOST_LINES + 7):
        log.line("again")
    log.close("finished", {})
    assert "... and 7 lines more that are not kept" in log.lines
    assert len(log.lines) < MOST_LINES + 100


def test_request_columns(tmp_path: Path) -> None:
    assert "Post_Request" in added(REQUEST)
    with recorded(tmp_path) as results:
        attributes = results._file["requests/7"].attrs
        assert list(attributes["columns"])[-3:] == ["psi", "theta", "phi"]
        assert attributes["label"] == "ball"
