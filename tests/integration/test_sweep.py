"""`mbsim sweep`: rows are what single runs give, whoever runs them, and no run is lost."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from contextlib import closing

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.folders import PACKAGES
from mbsim import open_results, read_model, simulate
from mbsim.cli.main import main
from mbsim.errors import Interrupted, ModelError, ResultsError, SolverError
from mbsim.studies.formulas import Formula
from mbsim.studies.journal import Journal, rows_kept
from mbsim.studies.local import MOST_TRIES, Workers
from mbsim.studies.stopping import Stop, number_of, stoppable
from mbsim.studies.study import read_study
from mbsim.studies.sweep import described, sweep
from mbsim.studies.table import Responses, write_table
from mbsim.studies.uncertainty import sobol_indices
from mbsim.studies.worker import PoolLost, failed

pytest.importorskip("pyarrow")

MODEL = PACKAGES / "models" / "bowling_ball.xml"
STUDY = """
[study]
model = "{model}"
design = "latin_hypercube"
runs = {runs}
seed = 3
[run]
end_time = {end}
[parameters]
k = {{ path = "Force_Contact[301].stiffness", low = 5e7, high = 2e8, scale = "log" }}
mu = {{ low = 0.1, high = 0.3 }}
[set]
"Force_Contact[301].cff_param_string" = "USER({{mu}},{{0.9*mu}},0.02,0.02)"
[outputs]
x = {{ signal = "bodies/2/position/x" }}
depth = {{ signal = "contacts/301/peak_penetration" }}
speed = {{ signal = "bodies/2/velocity/x", reduce = "curve" }}
early = {{ signal = "bodies/2/velocity/x", at = 0.02 }}
mean = {{ formula = "x/{end}" }}
"""


def study_file(folder, text=STUDY, runs=12, end=0.05, model=MODEL):
    path = folder / "ball.toml"
    path.write_text(text.format(model=model, runs=runs, end=end))
    return path


def bytes_of(study, folder, **how):
    return sweep(study, folder, **how).table.read_bytes()


def test_rows_are_those_of_single_runs(tmp_path):
    study = read_study(study_file(tmp_path))
    table = Responses(sweep(study, tmp_path / "out", workers=1).table)
    assert set(table["status"]) == {"finished"}
    for run in (0, 5, 11):
        mu, k = table["mu"][run], table["k"][run]
        changes = {
            "Force_Contact[301].stiffness": k,
            "Force_Contact[301].cff_param_string": f"USER({mu},{0.9 * mu},0.02,0.02)",
        }
        results = simulate(read_model(MODEL, changes), end_time=0.05)
        assert table["x"][run] == results["bodies/2/position/x"][-1]
        assert table["depth"][run] == results["contacts/301/peak_penetration"]
        assert table["speed"][run] == results["bodies/2/velocity/x"].tolist()
        assert table["early"][run] == results["bodies/2/velocity/x"][2]
        assert table["mean"][run] == table["x"][run] / 0.05


def test_the_table_is_the_same_for_any_number_of_workers_and_when_one_is_killed(tmp_path):
    study = read_study(study_file(tmp_path, runs=40))
    one = bytes_of(study, tmp_path / "one", workers=1)
    assert bytes_of(study, tmp_path / "two", workers=2) == one
    rows, workers = {}, Workers(study, 2)
    for row in workers.rows(range(40)):
        rows[row.run] = row
        if len(rows) in (5, 15):
            busy = next(w for w in workers._workers if w.runs)
            os.kill(busy.process.pid, signal.SIGKILL)
    assert workers.died == 2
    keys = [study.key(run, described(study)[0]) for run in range(40)]
    write_table(tmp_path / "killed.parquet", study, keys, [rows[run] for run in range(40)])
    assert (tmp_path / "killed.parquet").read_bytes() == one


def test_a_run_that_kills_its_worker_is_a_row_and_is_tried_once_more_on_resume(tmp_path):
    (tmp_path / "deadly.py").write_text(
        "import os\n"
        "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"
        "    if par[0] > 0.25:\n"
        "        os._exit(7)\n"
        "    return [0.0, 0.0, 0.0]\n"
    )
    shutil.copy(MODEL, tmp_path / "ball.xml")
    text = STUDY.replace("{{ low = 0.1, high = 0.3 }}", "{{ values = [0.1, 0.3, 0.2] }}")
    text = text.replace('design = "latin_hypercube"\nruns = {runs}', 'design = "grid"')
    text = text.replace('low = 5e7, high = 2e8, scale = "log"', "values = [1e8]")
    text = text.replace("[set]", '[set]\n"Force_Contact[301].script_name" = "deadly.py"')
    study = read_study(study_file(tmp_path, text, end=0.02, model="ball.xml"))
    swept = sweep(study, tmp_path / "out", workers=2)
    assert swept.counts == {"finished": 2, "failed": 1}
    assert swept.reasons == [(1, f"its process died {MOST_TRIES} times, exit code 7")]
    table = Responses(swept.table)
    assert table["status"].tolist() == ["finished", "failed", "finished"]
    assert np.isnan(table["x"][1])
    assert sweep(study, tmp_path / "out", workers=1, resume=True).kept == 2


def test_a_broken_study_goes_on_where_it_was(tmp_path):
    study = read_study(study_file(tmp_path))
    whole = bytes_of(study, tmp_path / "out", workers=1)
    journal = tmp_path / "out" / "ball.rows"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:7]) + lines[7][:40])  # killed while it wrote
    done = []
    swept = sweep(
        study, tmp_path / "out", workers=1, resume=True, progress=lambda n, of: done.append((n, of))
    )
    assert swept.kept == 7
    assert done[0] == (7, 12)
    assert done[-1] == (12, 12)
    assert swept.table.read_bytes() == whole
    keys = {study.key(run, described(study)[0]): run for run in range(12)}
    assert sorted(rows_kept(journal, keys)) == list(range(12))


def test_rows_of_other_runs_are_not_taken(tmp_path):
    study = read_study(study_file(tmp_path))
    sweep(study, tmp_path / "out", workers=1)
    for text in (
        STUDY.replace("seed = 3", "seed = 4"),
        STUDY.replace("[run]", "[run]\ntol = 1e-6"),
        STUDY.replace("0.9*mu", "0.8*mu"),
        STUDY.replace("at = 0.02", "at = 0.03"),
    ):
        other = read_study(study_file(tmp_path, text))
        keys = {other.key(run, described(other)[0]): run for run in range(12)}
        assert rows_kept(tmp_path / "out" / "ball.rows", keys) == {}, text
    # a longer study of the same seed may have some of them
    more = read_study(study_file(tmp_path, STUDY.replace("latin_hypercube", "sobol"), runs=8))
    sweep(more, tmp_path / "more", workers=1)
    more = read_study(study_file(tmp_path, STUDY.replace("latin_hypercube", "sobol"), runs=16))
    assert sweep(more, tmp_path / "more", workers=1, resume=True).kept == 8


def test_a_deck_or_script_that_changes_makes_other_runs(tmp_path):
    script = (PACKAGES / "userfuncs" / "coulomb_stribeck.py").read_text()
    (tmp_path / "own.py").write_text(script)
    deck = MODEL.read_text().replace("../userfuncs/coulomb_stribeck.py", "own.py")
    (tmp_path / "ball.xml").write_text(deck)
    study = read_study(study_file(tmp_path, model="ball.xml"))
    found = {described(study)[0]}
    (tmp_path / "own.py").write_text(script + "\n# changed\n")
    found.add(described(study)[0])
    (tmp_path / "ball.xml").write_text(deck.replace('mass="5"', 'mass="6"'))
    found.add(described(study)[0])
    assert len(found) == 3


def test_what_fails_and_what_warns_is_marked(tmp_path):
    text = STUDY.replace("[set]", '[set]\n"Body_Rigid[2].mass" = "{{10*(mu-0.15)}}"')
    text = text.replace("at = 0.02", "at = 0.025")  # between output rows
    study = read_study(study_file(tmp_path, text))
    swept = sweep(study, tmp_path / "out", workers=1)
    table = Responses(swept.table)
    warned = int(np.count_nonzero(table["mu"] >= 0.15))
    assert swept.warnings == [(warned, "outputs.early: no output row at time 0.025")]
    light = table["mu"] < 0.15
    assert 0 < light.sum() < 12
    assert (table["status"] == np.where(light, "failed", "warned")).all()
    for reason in table["reason"][light]:
        assert "mass" in reason
    for reason in table["reason"][~light]:
        assert reason == "outputs.early: no output row at time 0.025"
    assert np.isnan(table["early"]).all()
    assert not np.isnan(table["x"][~light]).any()


def test_a_study_of_which_no_run_ends_is_an_error(tmp_path):
    text = STUDY.replace("[run]", "[run]\nmost_evaluations = 3")
    with pytest.raises(SolverError, match="not one of 12 runs came to its end: TooMuchWork"):
        sweep(read_study(study_file(tmp_path, text)), tmp_path / "out", workers=1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("bodies/2/position/x", "bodies/9/position/x"), "outputs: bodies/9/position/x: this"),
        (("301].stiffness", "302].stiffness"), r"no Force_Contact\[302\]"),
        (("[run]", '[run]\nintegrator = "NONE"'), "NONE"),
        (("301].stiffness", "301].stifness"), r"toml: parameters.k.path: Force_.*did you mean"),
        (("position/x", "position"), "outputs.x: bodies/2/position is a vector"),
    ],
)
def test_what_no_run_can_do_is_said_before_the_first(tmp_path, change, said):
    study = read_study(study_file(tmp_path, STUDY.replace(*change)))
    with pytest.raises(ModelError, match=said):
        sweep(study, tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[set]", '[set]\n"force_contact[301].STIFFNESS" = 1'), "a parameter sets it too"),
        (
            ("low = 0.1, high = 0.3", 'distribution = "normal", mean = 0, sd = 1e-3, low = 0.1'),
            "parameters.mu: nothing of it is left between low and high",
        ),
        (("low = 0.1, high = 0.3", "lo = 0.1, values = [1]"), "unknown lo; known: path, values"),
        (("low = 0.1, high = 0.3", "values = []"), "one at least"),
        (("latin_hypercube", "lhs"), "must be one of grid, [a-z_, ]*csv$"),
    ],
)
def test_what_is_wrong_with_a_study_is_said_when_it_is_read(tmp_path, change, said):
    with pytest.raises(ModelError, match=said):
        read_study(study_file(tmp_path, STUDY.replace(*change)))


def test_parameters_of_a_csv_need_no_values(tmp_path):
    text = STUDY.replace('design = "latin_hypercube"\nruns = {runs}', 'csv = "ball.csv"')
    text = text.replace(', low = 5e7, high = 2e8, scale = "log"', "").replace(
        "mu = {{ low = 0.1, high = 0.3 }}", "mu = {{}}"
    )
    (tmp_path / "ball.csv").write_text("mu,k\n0.1,1e8\n0.2,2e8\n")
    assert read_study(study_file(tmp_path, text)).points.tolist() == [[1e8, 0.1], [2e8, 0.2]]
    (tmp_path / "ball.csv").write_text("mu,k,k\n0.1,1e8,1e8\n")
    with pytest.raises(ModelError, match="columns that are there twice: k"):
        read_study(study_file(tmp_path, text))


def test_a_formula_takes_no_longer_than_arithmetic_of_floats():
    with pytest.raises(ArithmeticError, match="out of range"):
        Formula("9**9**9**9", [])({})
    with pytest.raises(ModelError, match="is no formula"):
        Formula("-" * 100_000 + "1", [])
    assert Formula("2**3 + 7/2", [])({}) == 11.5


def test_signals_end_a_study_and_keep_its_rows(tmp_path, monkeypatch):
    with pytest.raises(Stop) as stopped, stoppable():
        os.kill(os.getpid(), signal.SIGTERM)
    assert number_of(stopped.value) == signal.SIGTERM
    study = read_study(study_file(tmp_path))

    def stop(done, of):
        if done == 2:
            raise Stop(signal.SIGTERM)

    with pytest.raises(Interrupted, match=r"2 of 12 runs are kept in .*; --resume") as ended:
        sweep(study, tmp_path / "out", workers=1, progress=stop)
    assert ended.value.exit_code == 143

    def lost(*_):
        raise PoolLost("the scheduler does not answer any more")
        yield

    monkeypatch.setattr("mbsim.studies.sweep._rows", lost)
    with pytest.raises(ResultsError, match="any more: 2 of 12 runs are kept"):
        sweep(study, tmp_path / "out", resume=True)


def test_a_folder_is_one_sweeps_at_a_time(tmp_path):
    path = tmp_path / "ball.jsonl"
    row = failed(0, "no")
    with closing(Journal(path, False)) as journal:
        journal.add("a", row)
        for resume in (False, True):
            with pytest.raises(ResultsError, match="another sweep writes it"):
                Journal(path, resume)
    assert rows_kept(path, {"a": 0}) == {0: row}
    Journal(path, True).close()
    assert rows_kept(path, {"a": 0}) == {0: row}
    Journal(path, False).close()
    assert rows_kept(path, {"a": 0}) == {}


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = study_file(tmp_path, STUDY.replace("seed = 3", "seed = 3\nkeep = [2]"))
    runner = CliRunner()
    found = runner.invoke(main, ["sweep", str(file), "--workers", "1", "--json"])
    assert found.exit_code == 0, found.output
    about = json.loads(found.stdout)
    assert about["runs"] == about["finished"] == 12
    assert about["table"] == "ball/ball.parquet"
    table = Responses(tmp_path / "ball" / "ball.parquet")
    said = json.loads(runner.invoke(main, ["info", "ball/ball.parquet", "--json"]).stdout)
    assert said["kind"] == "study"
    assert said["status"] == {"finished": 12}
    assert said["outputs"]["x"]["most"] == table["x"].max()
    with open_results(tmp_path / "ball" / "run-2" / "bowling_ball.h5") as results:
        assert results["bodies/2/position/x"][-1] == table["x"][2]
    found = runner.invoke(main, ["sweep", str(file), "--only", "4"])
    assert found.output == "ball/run-4: finished\n"
    found = runner.invoke(main, ["plot", "ball/ball.parquet", "x", "mu", "-o", "x.svg"])
    assert found.output == "x.svg: 1 x 1 panels, 12 runs\n"
    found = runner.invoke(main, ["plot", "ball/ball.parquet", "x", "mu", "-o", "x.svg", "--json"])
    drawn = {"picture": "x.svg", "table": "ball/ball.parquet", "parameters": ["mu"]}
    drawn |= {"outputs": ["x"], "runs": 12, "failed": 0, "warnings": []}
    assert json.loads(found.stdout) == drawn
    found = runner.invoke(main, ["plot", "ball/ball.parquet", "--x", "mu"])
    assert found.exit_code == 2
    assert "--x is for result files, not for a study's table" in found.output
    found = runner.invoke(main, ["plot", "ball/ball.parquet", "nothing"])
    assert found.exit_code == 2
    assert "no column nothing to draw; there is k, mu, x" in found.output
    found = runner.invoke(main, ["sweep", str(file), "--only", "12"])
    assert found.exit_code == 2
    assert "no run 12; runs are 0 to 11" in found.output


def test_bands_and_sobol_indices_beside_the_table(tmp_path, monkeypatch):
    pytest.importorskip("SALib")
    monkeypatch.chdir(tmp_path)
    text = STUDY.replace("latin_hypercube", "saltelli").replace(', scale = "log"', "")
    text += 'sum = {{ formula = "k/1.5e8 + 15*mu" }}\nlate = {{ formula = "log(mu - 0.12)" }}\n'
    file = study_file(tmp_path, text, runs=32 * 4, end=0.02)
    found = CliRunner().invoke(main, ["sweep", str(file), "--workers", "1"])
    assert found.exit_code == 0, found.output
    about = json.loads((tmp_path / "ball" / "ball.uncertainty.json").read_text())
    # widths 1 and 3: variances 1/12 and 9/12
    indices = about["indices"]["sum"]["parameters"]
    for name, part in (("k", 0.1), ("mu", 0.9)):
        for kind in ("first", "total"):
            assert abs(indices[name][kind] - part) < indices[name][f"{kind}_95"]
    # those of the design itself, so run and row belong together
    k, mu = read_study(file).points.T
    assert indices == sobol_indices(k / 1.5e8 + 15.0 * mu, ["k", "mu"], 3)["parameters"]
    band = about["bands"]["sum"]
    assert (about["runs"], band["used"], band["missing"]) == (128, 64, 0)
    assert abs(band["mean"] - (1.25 / 1.5 + 3.0)) < 3.0 * band["mean_se"]
    assert band["sd"] == pytest.approx(math.sqrt(10.0 / 12.0), rel=0.05)
    # how deep the ball goes is for the stiffness to say
    depth = about["indices"]["depth"]["parameters"]
    assert depth["k"]["total"] + depth["k"]["total_95"] > 0.95
    assert abs(depth["mu"]["total"]) < 0.05
    table = Responses(tmp_path / "ball" / "ball.parquet")
    missing = int(np.isnan(table["late"]).sum())
    assert missing > 0
    assert f"no Sobol indices of late: {missing} of 128 runs have no value" in found.output
    assert re.search(r"^depth +k +[01]\.\d+", found.output, re.MULTILINE)


def test_resume_says_what_is_kept_and_what_is_left(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few, more = study_file(tmp_path, runs=5), tmp_path / "more"
    more.mkdir()
    runner, how = CliRunner(), ["-o", "out", "--workers", "1"]
    found = runner.invoke(main, ["sweep", str(few), *how])
    assert "kept" not in found.stderr
    rows = tmp_path / "out" / "ball.rows"
    lines = rows.read_bytes().splitlines(keepends=True)
    rows.write_bytes(b"".join(lines[:-2]))
    found = runner.invoke(main, ["sweep", str(few), *how, "--resume"])
    assert found.exit_code == 0, found.output
    assert "mbsim: out/ball.rows: 3 of 5 runs are kept, 2 are left to do\n" in found.stderr
    found = runner.invoke(main, ["sweep", str(few), *how, "--resume"])
    assert "5 of 5 runs are kept, 0 are left to do" in found.stderr


def test_what_varies_by_rounding_only_has_no_indices(tmp_path, monkeypatch):
    pytest.importorskip("SALib")
    monkeypatch.chdir(tmp_path)
    # thrown along y of a marker that a right angle has turned: straight on but for rounding
    text = STUDY.replace("latin_hypercube", "saltelli").replace(', scale = "log"', "")
    text += 'aside = {{ signal = "bodies/2/position/y" }}\n'
    text += 'twice = {{ formula = "2*aside" }}\nboth = {{ formula = "aside + x" }}\n'
    deck = MODEL.read_text().replace("../userfuncs", str(MODEL.parents[1] / "userfuncs"))
    deck = deck.replace('v_ic_x="5" v_ic_x_flag', 'vm_id="11" v_ic_y="5" v_ic_y_flag')
    turned = '<Reference_Marker id="11" body_id="1" psi="-1.5707963267948966"/>'
    deck = deck.replace('<Reference_Marker id="20"', f'{turned}<Reference_Marker id="20"')
    (tmp_path / "bowling_ball.xml").write_text(deck)
    file = study_file(tmp_path, text, runs=16 * 4, end=0.1, model=tmp_path / "bowling_ball.xml")
    found = CliRunner().invoke(main, ["sweep", str(file), "--workers", "1"])
    assert found.exit_code == 0, found.output
    table = Responses(tmp_path / "ball" / "ball.parquet")
    assert 0.0 < np.ptp(table["aside"]) < 1e-12
    about = json.loads((tmp_path / "ball" / "ball.uncertainty.json").read_text())["indices"]
    assert about["aside"]["reason"].startswith("not seen: runs differ by ")
    assert about["twice"]["reason"] == "not seen: it is made of aside"
    assert "parameters" in about["both"]
    assert "parameters" in about["x"]
    assert "no Sobol indices of aside: not seen: " in found.output


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def joining(stream):
    """Return the event of a Dask worker having joined its scheduler; all that it says is read."""
    joined = threading.Event()

    def listen():
        with stream:
            for line in stream:
                if "Registered to" in line:
                    joined.set()

    threading.Thread(target=listen, daemon=True).start()
    return joined


@pytest.mark.slow
def test_a_cluster_makes_the_same_table_though_its_workers_are_killed(tmp_path):
    pytest.importorskip("distributed")
    study = read_study(study_file(tmp_path, runs=200))
    one = bytes_of(study, tmp_path / "one", workers=2)
    address = f"tcp://127.0.0.1:{free_port()}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    dask = [sys.executable, "-m", "dask"]
    started = [
        subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", address.split(":")[-1]],
            **quiet,
        )
    ]

    def worker():
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        heard = {**quiet, "stderr": subprocess.PIPE, "text": True}
        started.append(subprocess.Popen([*dask, "worker", address, *options], **heard))
        return joining(started[-1].stderr)

    def disturb(done, of):
        # one dies in the midst, and another takes its place
        if done in (60, 120):
            started[1 if done == 60 else 2].kill()
            assert worker().wait(60.0)

    try:
        worker()
        worker()
        swept = sweep(study, tmp_path / "dask", scheduler=address, progress=disturb)
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert swept.counts == {"finished": 200}
    assert swept.table.read_bytes() == one


def test_a_scheduler_that_does_not_answer(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from mbsim.studies import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    address = f"tcp://127.0.0.1:{free_port()}"
    with pytest.raises(ModelError, match="nobody answers"):
        sweep(read_study(study_file(tmp_path)), tmp_path / "out", scheduler=address)
    with pytest.raises(ModelError, match="must be such as tcp://host:8786"):
        sweep(read_study(study_file(tmp_path)), tmp_path / "out", scheduler="host")
