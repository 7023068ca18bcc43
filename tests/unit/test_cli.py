"""The command line: what goes where, exit codes, and what is not imported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import mbsim
from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from helpers.folders import PACKAGES
from helpers.minimal_deck import CONTACT_LINE, MINIMAL, deck
from mbsim.cli.main import COMMANDS, main
from mbsim.cli.messages import counted, with_severity
from mbsim.cli.progress import Display
from mbsim.errors import Interrupted, ModelError, PluginError, ResultsError, SolverError
from mbsim.results.reading import Results
from mbsim.results.recorder import Recorder
from mbsim.run import simulation


def call(*arguments: str) -> Result:
    """Run `mbsim` in this process; only bugs raise."""
    result = CliRunner().invoke(main, arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def process(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run Python with `mbsim` in a process of its own."""
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(PACKAGES)},
        check=False,
        **options,
    )


@pytest.fixture
def model(tmp_path: Path) -> str:
    """Write the minimal deck."""
    path = tmp_path / "ball.xml"
    path.write_text(MINIMAL)
    return str(path)


def fake_simulate(deck: Any, **options: Any) -> Results:
    """Record ten rows instead of a run; what `fail` names is raised as `simulate` does."""
    options["notify"]("compiling for this machine")
    system = fake_system(Path(options["output"]) / "deck")
    # the deck of the command line, whose name the results have
    system.model = deck
    recorder = Recorder(system, SETTINGS, options["output"])
    add_rows(system, 0, 10)
    recorder.take()
    error = fake_simulate.error
    status = "finished" if error is None else "failed"
    if error is not None:
        recorder.flush(checkpoint(10))
    stats = {"steps": 12, "rejected": 1, "wall_s": 0.5, "h_smallest": float("inf")}
    results = recorder.close(status, stats, system.scene.log.contacts)
    if error is not None:
        results.close()
        raise error
    fake_simulate.options = options
    return results


@pytest.fixture
def faked(monkeypatch: Any) -> Any:
    """Put the fake in place of the simulation."""
    fake_simulate.error = None
    monkeypatch.setattr(simulation, "simulate", fake_simulate)
    return fake_simulate


def test_python_m_mbsim_is_the_command_line(tmp_path: Path) -> None:
    done = process("-m", "mbsim", "check", "no.xml", cwd=PACKAGES)
    assert done.returncode == 2
    assert done.stderr == "mbsim: error: no.xml: cannot be read: No such file or directory\n"


# --- run -------------------------------------------------------------------------------------


def test_json_is_alone_on_standard_output(model: str, tmp_path: Path, faked: Any) -> None:
    result = call("run", model, "-o", str(tmp_path / "out"), "--json")
    assert result.exit_code == 0
    said = json.loads(result.stdout)
    assert set(said) == {"status", "result_file", "end_time", "stats", "audit", "bodies"}
    assert said["status"] == "finished"
    assert said["result_file"] == str(tmp_path / "out" / "ball.h5")
    assert said["end_time"] == pytest.approx(0.9)
    assert said["stats"]["h_smallest"] is None
    body = said["bodies"]["2"]
    assert set(body) == {"position", "quaternion", "velocity", "angular_velocity"}
    assert body["position"][0] == 9.0
    assert "compiling" in result.stderr


def test_summary_and_options(model: str, tmp_path: Path, faked: Any) -> None:
    out = str(tmp_path / "out")
    flags = ["--tol", "1e-8", "--end-time", "1", "--print-interval", "0.5", "--integrator", "X"]
    flags += ["--plugin", "a.py", "--plugin", "b.py", "--detector", "fcl", "--progress", "off"]
    result = call("run", model, "-o", out, *flags, "--interpret-plugins", "--allow-overlap")
    assert result.exit_code == 0
    assert "finished at time 0.9, 10 rows in" in result.stdout
    assert "12 steps, 1 rejected, 0.50 s" in result.stdout
    given = faked.options
    assert (given["tol"], given["end_time"], given["print_interval"]) == (1e-8, 1.0, 0.5)
    assert given["plugins"] == (Path("a.py"), Path("b.py"))
    assert (given["integrator"], given["detector"]) == ("X", "fcl")
    flags_given = [given[name] for name in ("interpret_plugins", "allow_overlap", "resume")]
    assert flags_given == [True, True, False]
    assert given["progress"] is None


def test_default_folder_has_the_name_of_the_model(model: str, monkeypatch: Any, faked: Any) -> None:
    folder = Path(model).parent
    monkeypatch.chdir(folder)
    assert call("run", "ball.xml").exit_code == 0
    assert (folder / "ball" / "ball.h5").is_file()


@pytest.mark.parametrize(
    ("error", "code"),
    [(SolverError("the step fell"), 3), (PluginError("oil.py:3"), 4), (Interrupted("stop"), 130)],
)
def test_a_run_that_ends_early(
    model: str, tmp_path: Path, faked: Any, error: Exception, code: int
) -> None:
    faked.error = error
    result = call("run", model, "-o", str(tmp_path / "out"))
    assert result.exit_code == code
    assert f"mbsim: error: {error}" in result.stderr
    assert "10 rows are kept in" in result.stderr
    assert result.stdout == ""
    result = call("run", model, "-o", str(tmp_path / "out"), "--json")
    assert result.exit_code == code
    assert json.loads(result.stdout)["status"] == "failed"


@pytest.mark.parametrize(("error", "code"), [(ModelError("no"), 2), (ResultsError("full"), 5)])
def test_a_run_that_does_not_begin(
    model: str, tmp_path: Path, faked: Any, error: Exception, code: int
) -> None:
    faked.error = error
    result = call("run", model, "-o", str(tmp_path / "out"), "--json")
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.splitlines()[-1] == f"mbsim: error: {error}"


def test_overrides_reach_the_deck(model: str, tmp_path: Path, faked: Any) -> None:
    result = call("run", model, "-o", str(tmp_path), "--set", "Force_Contact[301].mu=1")
    assert result.exit_code == 2
    assert "--set Force_Contact[301].mu=1" in result.stderr


def test_output_is_a_file(model: str, tmp_path: Path, faked: Any) -> None:
    result = call("run", model, "-o", model)
    assert result.exit_code == 5
    assert "is a file" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [("run",), ("walk",), ("run", "a.xml", "--tol", "small"), ("run", "a.xml", "--detector", "x")],
)
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    result = call(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_ctrl_c_outside_of_a_run(model: str, monkeypatch: Any) -> None:
    import mbsim.reader.xml

    def stop(*arguments: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(mbsim.reader.xml, "read_model", stop)
    result = call("check", model)
    assert result.exit_code == 130
    assert "interrupted" in result.stderr


def test_a_real_run(model: str, tmp_path: Path) -> None:
    arguments = ("-m", "mbsim.cli.main", "run", model, "-o", str(tmp_path / "out"))
    done = process(*arguments, "--end-time", "0.02", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["end_time"] == 0.02
    assert said["stats"]["steps"] > 0
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["ball.h5", "ball.log"]
    with mbsim.open_results(said["result_file"]) as results:
        assert len(results["time"]) == 3
        assert results["bodies/2/position"][-1].tolist() == said["bodies"]["2"]["position"]
    assert "end: finished" in (tmp_path / "out" / "ball.log").read_text()


# --- check -----------------------------------------------------------------------------------


def test_check_of_a_good_deck(model: str) -> None:
    result = call("check", model)
    assert result.exit_code == 0
    assert result.stdout.startswith(f"ok: {model}: 1 body, 2 markers, 2 graphics, 1 contact,")
    assert "Force_Contact[301]: Post_Graphic[200] Post_Graphic[100]: closed form" in result.stdout


def test_check_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(deck(('stiffness="1e8"', 'stiffness="-1"'), ('radius="0.108"', 'radius="x"')))
    result = call("check", str(path))
    assert result.exit_code == 2
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert lines[2:] == ["mbsim: see: mbsim manual post_graphic; mbsim manual force_contact"]
    assert lines[0].startswith(f"{path}:{CONTACT_LINE - 1}: error: Post_Graphic[200]")
    assert lines[1].startswith(f"{path}:{CONTACT_LINE + 1}: error: Force_Contact[301]")


def test_check_as_json(model: str, tmp_path: Path) -> None:
    result = call("check", model, "--json")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["ok"]
    assert found["counts"]["bodies"] == 1
    assert found["elements"][0]["element"] == "Force_Contact[301]"
    assert {message["severity"] for message in found["messages"]} == {"note"}
    path = tmp_path / "bad.xml"
    path.write_text(deck(('stiffness="1e8"', 'stiffness="-1"'), ('radius="0.108"', 'radius="x"')))
    result = call("check", str(path), "--json")
    assert result.exit_code == 2
    assert result.stderr == ""
    found = json.loads(result.stdout)
    assert not found["ok"]
    lines = [(fault["line"], fault["element"]) for fault in found["messages"]]
    assert lines == [
        (CONTACT_LINE - 1, "Post_Graphic[200]"),
        (CONTACT_LINE + 1, "Force_Contact[301]"),
    ]
    assert call("check", model, "--json", "--repair").exit_code == 2


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("a b.xml:12: Body_Rigid[2]: no", "a b.xml:12: error: Body_Rigid[2]: no"),
        ("deck.xml: cannot be read", "mbsim: error: deck.xml: cannot be read"),
        ("at 12:30: no", "mbsim: error: at 12:30: no"),
        ("f.py:3: Force_Contact[1]:\nTrace", "f.py:3: error: Force_Contact[1]:\nTrace"),
    ],
)
def test_file_and_line_come_first(text: str, printed: str) -> None:
    assert with_severity("error", text) == printed


def test_one_thing_is_not_told_as_many() -> None:
    assert [counted(1, name) for name in ("bodies", "rows")] == ["1 body", "1 row"]
    assert [counted(count, "bodies") for count in (0, 2)] == ["0 bodies", "2 bodies"]


def test_check_sees_what_a_run_would_refuse(tmp_path: Path) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(deck(('integr_tol="1e-3"', 'integr_tol="70"')))
    assert call("check", str(path)).exit_code == 2


def test_warnings_go_to_standard_error(tmp_path: Path) -> None:
    path = tmp_path / "odd.xml"
    path.write_text(deck(('mu_dynamic="0.2"', 'mu_dynamic="0.5"')))
    result = call("check", str(path))
    assert result.exit_code == 0
    assert result.stderr.startswith(f"{path}:")
    assert ": warning: Force_Contact[301]" in result.stderr
    assert "warning: " not in result.stdout


# --- info ------------------------------------------------------------------------------------


def test_info_of_a_model(model: str) -> None:
    result = call("info", model)
    assert result.exit_code == 0
    for said in ("NEWTON KILOGRAM METER SECOND", "IMPACT", "COULOMB_ON", "end_time 3"):
        assert said in result.stdout
    about = json.loads(call("info", model, "--json").stdout)
    assert about["kind"] == "model"
    assert about["bodies"]["2"]["mass"] == pytest.approx(5.0)


def test_info_of_results(model: str, tmp_path: Path, faked: Any) -> None:
    call("run", model, "-o", str(tmp_path / "out"))
    file = str(tmp_path / "out" / "ball.h5")
    result = call("info", file)
    assert result.exit_code == 0
    for said in ("finished", "bodies/2/position", "peak_force", "steps"):
        assert said in result.stdout
    about = json.loads(call("info", file, "--json").stdout)
    assert about["counts"] == {"rows": 10, "bodies": 1, "contacts": 1, "requests": 0, "events": 2}
    assert about["end_time"] == pytest.approx(0.9)


@pytest.mark.parametrize(("name", "code"), [("none.h5", 2), ("none.xml", 2)])
def test_info_of_nothing(tmp_path: Path, name: str, code: int) -> None:
    result = call("info", str(tmp_path / name))
    assert result.exit_code == code
    assert result.stderr.startswith("mbsim: error: ")


# --- main ------------------------------------------------------------------------------------


def test_help_and_version() -> None:
    result = call("--help")
    assert result.exit_code == 0
    for name in COMMANDS:
        assert name in result.stdout
        assert call(name, "--help").exit_code == 0
    assert mbsim.__version__ in call("--version").stdout


def test_a_bug_is_a_traceback(model: str, monkeypatch: Any) -> None:
    import mbsim.reader.xml

    def broken(*arguments: Any) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(mbsim.reader.xml, "read_model", broken)
    with pytest.raises(ZeroDivisionError):
        call("check", model)


def test_check_says_which_subroutine_needs_a_plugin(model: str, tmp_path: Path) -> None:
    text = Path(model).read_text()
    force = '<Force_Vector_OneBody id="7" type="ForceOnly" i_marker_id="20" {}/></Model>'
    given = force.format('usrsub_param_string="USER(1)" usrsub_fnc_name="VFOSUB"')
    deck = tmp_path / "deck.xml"
    deck.write_text(text.replace("</Model>", given))
    done = call("check", str(deck))
    assert "Force_Vector_OneBody[7]: its subroutine names no file" in done.output


def test_check_imports_little(model: str) -> None:
    code = (
        "import sys; from mbsim.cli.main import main\n"
        f"main(['check', {model!r}], standalone_mode=False)\n"
        "heavy = {'numba', 'h5py', 'fcl', 'rich', 'llvmlite', 'trimesh', 'matplotlib'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = process("-c", code)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_help_imports_no_numpy() -> None:
    code = (
        "import sys; from mbsim.cli.main import main\n"
        "main(['--help'], standalone_mode=False)\n"
        "print('numpy' in sys.modules)"
    )
    assert process("-c", code).stdout.splitlines()[-1] == "False"


def test_a_reader_that_goes_away(model: str) -> None:
    command = f'"{sys.executable}" -m mbsim.cli.main info "{model}" | true'
    done = subprocess.run(
        command,
        shell=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(PACKAGES)},
    )
    assert done.stderr == ""


def test_public_names() -> None:
    for name in mbsim.__all__:
        assert getattr(mbsim, name) is not None
        assert name in dir(mbsim)
    with pytest.raises(AttributeError, match="nothing"):
        mbsim.nothing  # noqa: B018


def test_progress_begins_late_and_ends_clean(capsys: Any) -> None:
    with Display() as display:
        display.say("first")
        display.update(0.5, 1e-3, 2.0)
        display.say("[second]")
        display.update(1.0, 1e-3, 2.0)
    caught = capsys.readouterr()
    assert caught.out == ""
    assert "mbsim: first" in caught.err
    assert "mbsim: [second]" in caught.err
