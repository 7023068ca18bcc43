"""Studies of runs: what they cannot do is said before the first run, with where it stands."""

from __future__ import annotations

import pytest

from helpers.folders import PACKAGES
from mbsim.cli.messages import with_severity
from mbsim.errors import ModelError
from mbsim.studies.problem import read_problem
from mbsim.studies.study import read_study
from mbsim.studies.sweep import described

pytest.importorskip("pyarrow")

MODEL = PACKAGES / "models" / "bouncing_sphere.xml"
SWEEP = f"""
[study]
model = "{MODEL}"
csv = "c.csv"
[run]
end_time = 0.4
[parameters]
c = {{ path = "Force_Contact[301].damping" }}
[outputs]
x = {{ signal = "contacts/301/peak_force" }}
"""
IDENTIFY = f"""
[study]
model = "{MODEL}"
[run]
end_time = 0.4
[parameters]
c = {{ path = "Force_Contact[301].damping", low = 1, high = 100 }}
[records.x]
file = "x.csv"
column = "x"
signal = "contacts/301/peak_force"
"""


def written(folder, text, **files):
    for name, rows in files.items():
        (folder / f"{name}.csv").write_text(rows)
    path = folder / "s.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("at = 0.1", "outputs.x: at: contacts/301/peak_force is one number a run"),
        ('reduce = "curve"', "outputs.x: curve: .* over time it is contacts/301/force/mag$"),
        ('reduce = "min"', "outputs.x: min: "),
    ],
)
def test_rows_of_a_peak_are_refused(tmp_path, how, said):
    text = SWEEP.replace('peak_force" }', f'peak_force", {how} }}')
    study = read_study(written(tmp_path, text, c="c\n1\n"))
    with pytest.raises(ModelError, match=said):
        described(study)


@pytest.mark.parametrize("reduce", ["last", "max", "absmax"])
def test_the_largest_of_a_peak_is_the_peak(tmp_path, reduce):
    text = SWEEP.replace('peak_force" }', f'peak_force", reduce = "{reduce}" }}')
    described(read_study(written(tmp_path, text, c="c\n1\n")))


def test_a_peak_is_no_record(tmp_path):
    with pytest.raises(ModelError, match=r"records\.x\.signal: contacts/301/peak_force is one"):
        read_problem(written(tmp_path, IDENTIFY, x="time,x\n0,1\n0.1,2\n0.2,3\n"))


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("c\n1\n\n# a note\n2\nx\n", r"c\.csv:6: c = 'x': must be a finite number$"),
        ("c\n1\nnan\n", r"c\.csv:3: c = 'nan': must be a finite number$"),
        ("c;d\n1;2\n3\n", r"c\.csv:3: has 1 cells, not 2$"),
        ("c\n" + 9 * "x\n", r"c\.csv:2: [^\0]*c\.csv:6: [^\0]*c\.csv: 4 more lines are wrong$"),
    ],
)
def test_a_wrong_cell_of_a_design_is_named_by_its_line(tmp_path, rows, said):
    with pytest.raises(ModelError, match=said):
        read_study(written(tmp_path, SWEEP, c=rows))


def test_designs_are_read_as_records_are(tmp_path):
    text = SWEEP.replace("[outputs]", 'k = { path = "Force_Contact[301].stiffness" }\n[outputs]')
    path = written(tmp_path, text, c="\ufeff# by hand\nk;c\n\n1e5; 3\n")
    assert read_study(path).points.tolist() == [[3.0, 1e5]]


def test_a_record_that_goes_back_in_time_is_named_by_its_line(tmp_path):
    text = IDENTIFY.replace("contacts/301/peak_force", "bodies/2/position/z")
    text = text.replace("[records.x]", '[records.x]\ntime_unit = "ms"')
    rows = "time,x\n0,1\n# a note\n100,2\n100,3\n200,3\n"
    with pytest.raises(ModelError, match=r"x\.csv: line 5: time = 100 follows 100: times must"):
        read_problem(written(tmp_path, text, x=rows))


@pytest.mark.parametrize(
    ("path", "option"),
    [
        ("simulate.END_TIME", "end_time = 0.4"),
        ("Simulate.print_interval", "print_interval = 0.1"),
        ("Param_Transient.integr_tol", "tol = 1e-5"),
    ],
)
@pytest.mark.parametrize("by_set", [False, True])
def test_a_parameter_that_an_option_stands_in_for_is_refused(tmp_path, path, option, by_set):
    text = SWEEP.replace("end_time = 0.4", option)
    key = f"parameters.c.path: {path}: run.{option.split()[0]} stands in"
    if by_set:
        text = text.replace("[outputs]", f'[set]\n"{path}" = "{{c/10}}"\n[outputs]')
        key = key.replace("parameters.c.path", "set")
    else:
        text = text.replace("Force_Contact[301].damping", path)
    with pytest.raises(ModelError, match=key.replace("[", r"\[")):
        read_study(written(tmp_path, text, c="c\n1\n"))


def test_a_place_within_a_message_is_not_its_beginning():
    line = "4 runs failed: DeckError: models/a.xml:11: Body_Rigid[2]: mass"
    assert with_severity("warning", line) == f"mbsim: warning: {line}"
    assert with_severity("error", "C:\\a b.xml:3: no") == "C:\\a b.xml:3: error: no"


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol", "random", "saltelli"])
def test_more_runs_than_anybody_means_are_refused_at_once(tmp_path, design):
    text = SWEEP.replace('csv = "c.csv"', f'design = "{design}"\nruns = 1000000000')
    text = text.replace('damping" }', 'damping", low = 1, high = 2 }')
    with pytest.raises(ModelError, match="runs = 1000000000: at most 10000000 are taken"):
        read_study(written(tmp_path, text))


def test_more_levels_than_anybody_means_are_refused_at_once(tmp_path):
    text = SWEEP.replace('csv = "c.csv"', 'design = "grid"')
    text = text.replace('damping" }', 'damping", low = 1, high = 2, count = 1000000000 }')
    with pytest.raises(ModelError, match="count = 1000000000: must be a whole number from 1 to"):
        read_study(written(tmp_path, text))


@pytest.mark.parametrize("at", ["0.5", "-0.1"])
def test_an_output_at_a_time_that_no_run_comes_to_is_refused(tmp_path, at):
    text = SWEEP.replace('contacts/301/peak_force"', f'bodies/2/position/z", at = {at}')
    study = read_study(written(tmp_path, text, c="c\n1\n"))
    with pytest.raises(ModelError, match=f"outputs.x: at = {at}: runs go from 0 to 0.4$"):
        described(study)
    by_parameter = text.replace("Force_Contact[301].damping", "Simulate.end_time")
    by_parameter = by_parameter.replace("[run]\nend_time = 0.4\n", "")
    described(read_study(written(tmp_path, by_parameter, c="c\n1\n")))
