"""`mbsim plot`: numbers in the lines, words around them, files, and what is refused."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, sphere, write_deck
from helpers.folders import MODELS, PACKAGES
from helpers.views import run_balls
from mbsim.cli.main import main
from mbsim.errors import ModelError, ResultsError, UnknownSignal
from mbsim.model.request_types import TYPES
from mbsim.results import quantities, requests
from mbsim.results.curves import Choice, collect, names_of
from mbsim.results.names import compact, matching
from mbsim.results.reading import open_results
from mbsim.results.units import TIME, Quantity, UnitSystem

pytest.importorskip("matplotlib", reason="pictures need matplotlib")

from mbsim.results.drawing import draw, save

REQUESTS = """
<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20" label="top $1_x"/>
<Post_Request id="8" type="MARKER_VELOCITY" i_marker_id="30"/>
"""
DECK = (
    GROUND
    + sphere(0.15, v=(0.5, 0.0, 0.0))
    + sphere(0.4, body=3, x=1.0).replace('id="3"', 'id="3" label="high"', 1)
    + contact(stiffness="1e5", damping="5", dmax="1e-3")
    + GRAVITY
    + REQUESTS
)


def run(folder, name, end_time=0.3, **settings):
    path = write_deck(folder, DECK, end_time=end_time, name=f"{name}.xml")
    mbsim.simulate(mbsim.read_model(path), output=folder / name, **settings).close()
    return folder / name / f"{name}.h5"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two runs of two balls that fall, at different tolerances."""
    folder = tmp_path_factory.mktemp("runs")
    return run(folder, "fine", tol=1e-9), run(folder, "coarse", tol=1e-4)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*arguments):
    result = CliRunner().invoke(main, ["plot", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def picture(*paths, minus=None, **choice):
    opened = [open_results(path) for path in paths]
    other = None if minus is None else open_results(minus)
    try:
        return collect(opened, Choice(**choice), other)
    finally:
        for results in (*opened, *filter(None, (other,))):
            results.close()


def lines(figure):
    """Return the data of all lines by panel's axis text and line's signal."""
    return {
        (axis.get_ylabel(), line.get_gid()): line.get_xydata().T
        for axis in figure.axes
        for line in axis.get_lines()
    }


def legends(figure):
    return [[text.get_text() for text in axis.get_legend().get_texts()] for axis in figure.axes]


# --- numbers and words -----------------------------------------------------------------------


def test_lines_hold_the_numbers_of_the_file(files):
    names = ("bodies/2/position/z", "contacts/301/force/mag", "energy/kinetic", "requests/7/F2")
    figure = draw(picture(files[0], names=names))
    with open_results(files[0]) as results:
        expected = {name: results[name] for name in names}
        time = results["time"]
        assert np.linalg.norm(results["contacts/301/force"], axis=1) == pytest.approx(
            expected["contacts/301/force/mag"]
        )
    drawn = lines(figure)
    assert list(drawn) == [
        ("Position [m]", "bodies/2/position/z"),
        ("Force [N]", "contacts/301/force/mag"),
        ("Energy [J]", "energy/kinetic"),
        ("Displacement [m]", "requests/7/F2"),
    ]
    for (_, name), (x, y) in drawn.items():
        np.testing.assert_array_equal(x, time)
        np.testing.assert_array_equal(y, expected[name])
    assert figure.axes[-1].get_xlabel() == "Time [s]"
    assert figure.get_suptitle() == "fine"
    assert figure.axes[0].get_xlim() == (0.0, pytest.approx(0.3))


def test_a_vector_is_its_components_and_a_quantity_is_a_panel(files):
    names = ("bodies/3/velocity", "bodies/2/velocity/mag", "bodies/2/quaternion", "requests/8")
    figure = draw(picture(files[0], names=names))
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "Velocity [m/s]",
        "Quaternion",
        "Angular velocity [rad/s]",
    ]
    # requests/8 is of a velocity: F1 to F4 stand with the other velocities
    assert legends(figure)[0] == [
        *(f"body 3 (high), {axis}" for axis in "xyz"),
        "body 2, magnitude",
        *(f"request 8, F{k + 1} = {what}" for k, what in enumerate(("mag", "vx", "vy", "vz"))),
    ]
    assert legends(figure)[1] == [f"body 2, {part}" for part in "wxyz"]


def test_components_of_a_request_have_their_own_units(files):
    drawn = picture(files[0], names=("requests/7",))
    assert [(panel.axis, len(panel.curves)) for panel in drawn.panels] == [
        ("Displacement [m]", 4),
        ("Angle [rad]", 4),
    ]


def test_wildcards_give_each_curve_once(files):
    drawn = picture(files[0], names=("bodies/*/velocity/mag", "bodies/3/velocity/mag"))
    assert [curve.name for curve in drawn.panels[0].curves] == [
        "bodies/2/velocity/mag",
        "bodies/3/velocity/mag",
    ]
    assert len(picture(files[0], names=("energy/*",)).panels[0].curves) == 3


def test_files_over_each_other(files):
    drawn = picture(*files, names=("bodies/2/position/z", "bodies/3/position/z"))
    figure = draw(drawn)
    assert legends(figure)[0] == [
        "fine: body 2, z",
        "coarse: body 2, z",
        "fine: body 3 (high), z",
        "coarse: body 3 (high), z",
    ]
    ys = [line.get_ydata() for line in figure.axes[0].get_lines()]
    for path, id, y in zip(files * 2, (2, 2, 3, 3), ys, strict=True):
        with open_results(path) as results:
            np.testing.assert_array_equal(y, results[f"bodies/{id}/position/z"])
    first, second = figure.axes[0].get_lines()[:2]
    # same signal, same colour; other file, other line
    assert first.get_color() == second.get_color()
    assert first.get_linewidth() > second.get_linewidth()
    assert first.get_linestyle() != second.get_linestyle()


def test_signals_of_one_file_differ_without_colour(files):
    figure = draw(picture(files[0], names=("bodies/2/position", "bodies/3/position/z")))
    looks = {line.get_linestyle() + str(line._dash_pattern) for line in figure.axes[0].get_lines()}
    assert len(looks) == 4


def test_other_units_are_converted_to_those_of_the_first_file(tmp_path):
    paths = []
    for name in ("drop_m", "drop_mm"):
        deck = mbsim.read_model(MODELS / f"{name}.xml")
        mbsim.simulate(deck, output=tmp_path, end_time=0.3).close()
        paths.append(tmp_path / f"{name}.h5")
    names = ("bodies/2/position/z", "energy/potential", "contacts/301/area")
    metres, millimetres = picture(*paths, names=names), picture(*paths[::-1], names=names)
    assert [panel.unit for panel in metres.panels] == ["m", "J", "m²"]
    assert [panel.unit for panel in millimetres.panels] == ["mm", "N·mm", "mm²"]
    for panel in metres.panels:
        first, second = panel.curves
        np.testing.assert_allclose(second.y, first.y, rtol=1e-9, atol=1e-12)
    one = metres.panels[0].curves[0].y
    np.testing.assert_allclose(millimetres.panels[0].curves[1].y, 1000.0 * one, rtol=1e-12)
    assert any("converted to N, m, s" in note for note in metres.notes)


def test_difference_of_two_runs(files):
    drawn = picture(files[0], minus=files[1], names=("bodies/2/position/x",))
    with open_results(files[0]) as fine, open_results(files[1]) as coarse:
        expected = fine["bodies/2/position/x"] - coarse["bodies/2/position/x"]
    np.testing.assert_array_equal(drawn.panels[0].curves[0].y, expected)
    assert drawn.title == "fine minus coarse"
    assert drawn.panels[0].axis == "Δ position [m]"
    log = picture(files[0], minus=files[1], names=("bodies/2/position/x",), log=True)
    assert log.panels[0].axis == "|Δ position| [m]"
    np.testing.assert_array_equal(
        log.panels[0].curves[0].y, np.where(expected == 0.0, np.nan, np.abs(expected))
    )


def test_difference_takes_times_that_both_have(files, tmp_path):
    sparse = tmp_path / "sparse.h5"
    shutil.copy(files[0], sparse)
    with h5py.File(sparse, "r+") as file:
        for name in ("time", "bodies/position"):
            rows = file[name][::3]
            del file[name]
            file[name] = rows
    drawn = picture(files[0], minus=sparse, names=("bodies/2/position/z",))
    curve = drawn.panels[0].curves[0]
    np.testing.assert_allclose(curve.x, 0.01 * np.arange(0, 31, 3), atol=1e-12)
    np.testing.assert_array_equal(curve.y, 0.0)
    assert any("20 without a row at their time" in note for note in drawn.notes)
    with h5py.File(sparse, "r+") as file:
        file["time"][...] += 0.005
    with pytest.raises(ModelError, match=r"no output time in common.*--print-interval"):
        picture(files[0], minus=sparse, names=("bodies/2/position/z",))


def test_one_signal_over_another(files):
    figure = draw(
        picture(files[0], names=("bodies/2/velocity/z",), over="bodies/2/position/z", start=0.1)
    )
    (data,) = lines(figure).values()
    with open_results(files[0]) as results:
        rows = results["time"] >= 0.1
        np.testing.assert_array_equal(data[0], results["bodies/2/position/z"][rows])
        np.testing.assert_array_equal(data[1], results["bodies/2/velocity/z"][rows])
    assert figure.axes[0].get_xlabel() == "Position, body 2, z [m]"
    with pytest.raises(UnknownSignal, match=r"--x: bodies/2/position is more than one"):
        picture(files[0], names=("energy/kinetic",), over="bodies/2/position")


def test_range_of_time(files):
    drawn = picture(files[0], names=("energy/kinetic",), start=0.1, end=0.2)
    x = drawn.panels[0].curves[0].x
    assert (x[0], x[-1]) == (pytest.approx(0.1), pytest.approx(0.2))
    assert draw(drawn).axes[0].get_xlim() == (0.1, 0.2)
    with pytest.raises(ModelError, match=r"rows go from 0 to 0\.3"):
        picture(files[0], names=("energy/kinetic",), start=5.0)


def test_log_axis_leaves_out_what_it_cannot_show(files):
    drawn = picture(files[0], names=("contacts/301/penetration",), log=True)
    y = drawn.panels[0].curves[0].y
    assert np.nanmin(y) > 0.0
    lost = int(np.isnan(y).sum())
    assert lost > 0
    assert f"Penetration: {lost} of 31 values are not above 0 and not drawn" in drawn.notes
    assert draw(drawn).axes[0].get_yscale() == "log"
    with pytest.raises(ModelError, match=r"--log: Position \[m\] has no value above 0"):
        picture(files[0], names=("bodies/2/position/y",), log=True)


def test_a_log_axis_of_few_decades_has_plain_numbers(files):
    figure = draw(picture(files[0], names=("bodies/3/position/z",), log=True))
    formatter = figure.axes[0].yaxis.get_minor_formatter()
    formatter.set_locs(figure.axes[0].yaxis.get_minorticklocs())
    assert formatter(0.3) == "0.3"


def test_points_between_gaps_are_marked(files):
    drawn = picture(files[0], names=("energy/kinetic",))
    drawn.panels[0].curves[0].y[[3, 5, 6, 7]] = np.nan
    (line,) = draw(drawn).axes[0].get_lines()
    assert (line.get_marker(), line.get_markevery()) == ("o", [4])


def test_legends_stay_inside(files, here):
    figure = draw(picture(*files, names=("bodies/*/quaternion", "requests/7")))
    save(figure, here / "a.png")
    right = figure.bbox.x1
    for axis in figure.axes:
        assert axis.get_legend().get_window_extent().x1 <= right
        # and the panel has most of the width
        assert axis.get_window_extent().width > 0.8 * right


def test_events_are_marked(files):
    drawn = picture(files[0], names=("bodies/2/position/z",), events=True)
    with open_results(files[0]) as results:
        table = results["events"]
    for kind in ("touch", "leave"):
        np.testing.assert_array_equal(drawn.events[kind], table["time"][table["kind"] == kind])
        assert len(drawn.events[kind]) >= 1
    figure = draw(drawn)
    assert legends(figure)[0][1:] == [f"{k} ({len(t)})" for k, t in drawn.events.items()]
    marked = [c.get_segments()[0][0][0] for c in figure.axes[0].collections]
    assert marked == [times[0] for times in drawn.events.values()]


def test_peaks_between_rows_are_said(files):
    drawn = picture(files[0], names=("contacts/301/force/mag", "contacts/301/slip_speed"))
    with open_results(files[0]) as results:
        peak = results["contacts/301/peak_force"]
        assert peak > 1.02 * results["contacts/301/force/mag"].max()
    said = f"force of contact 301 reaches {peak:.4g} N between output rows"
    assert said in drawn.notes
    restricted = picture(files[0], names=("contacts/301/force/mag",), end=0.1)
    assert not any("between output rows" in note for note in restricted.notes)


# --- runs that are not complete --------------------------------------------------------------


@pytest.mark.parametrize(
    ("status", "said"),
    [
        ("failed", "failed at 0.3 of 0.9 s"),
        ("interrupted", "interrupted at 0.3 of 0.9 s"),
        ("running", "not finished (still running, or killed) at 0.3 of 0.9 s"),
    ],
)
def test_a_run_without_end_says_so(files, here, status, said):
    shutil.copy(files[0], here / "broken.h5")
    with h5py.File(here / "broken.h5", "r+") as file:
        file.attrs.update({"status": status, "end_time": 0.9})
    drawn = picture("broken.h5", names=("energy/kinetic",))
    assert draw(drawn).get_suptitle() == f"broken\n{said}"
    # among others it says which one
    both = picture(files[0], here / "broken.h5", names=("energy/kinetic",))
    assert both.warnings == [f"broken: {said}"]
    off = picture(files[0], minus=here / "broken.h5", names=("energy/kinetic",))
    assert off.warnings == [f"broken: {said}"]
    result = call("broken.h5", "energy/kinetic", "-o", "a.png")
    assert result.exit_code == 0
    assert f"mbsim: warning: {said}" in result.stderr


def test_a_file_that_some_signal_is_not_in(files, here):
    shutil.copy(files[0], here / "other.h5")
    with h5py.File(here / "other.h5", "r+") as file:
        del file["energy"]
    drawn = picture(files[0], here / "other.h5", names=("energy/kinetic", "bodies/2/position/z"))
    assert [len(panel.curves) for panel in drawn.panels] == [1, 2]
    assert "other has no energy/kinetic" in drawn.notes


def test_no_rows_and_one_row(files, here):
    shutil.copy(files[0], here / "short.h5")
    for rows in (1, 0):
        with h5py.File(here / "short.h5", "r+") as file:
            for name in ("time", "energy/kinetic"):
                kept = file[name][:rows]
                del file[name]
                file[name] = kept
        if rows:
            figure = draw(picture(here / "short.h5", names=("energy/kinetic",)))
            (line,) = figure.axes[0].get_lines()
            assert line.get_marker() == "o"
    with pytest.raises(ResultsError, match="has no output rows"):
        picture(here / "short.h5", names=("energy/kinetic",))


@pytest.mark.parametrize("keep", [0, 5000])
def test_an_empty_or_cut_file_is_one_line(files, here, keep):
    (here / "cut.h5").write_bytes(files[0].read_bytes()[:keep])
    result = call("cut.h5", "energy/kinetic")
    assert result.exit_code == 5
    assert result.stderr.count("\n") == 1
    assert "cut.h5: cannot be read: not an HDF5 file, or a damaged one" in result.stderr


def test_bytes_that_changed_are_one_line(files, here):
    data = bytearray(files[0].read_bytes())
    # the header messages of all objects, but not of the file
    for k in range(96, len(data), 7):
        data[k] ^= 0x55
    (here / "junk.h5").write_bytes(data)
    result = call("junk.h5", "energy/kinetic")
    assert result.exit_code == 5
    assert re.fullmatch(r"mbsim: error: junk\.h5: cannot be read.*\n", result.stderr)


# --- the command -----------------------------------------------------------------------------


def test_default_name_and_what_is_said(files, here):
    result = call(files[0], "bodies/2/position/z", "energy/*")
    assert result.exit_code == 0, result.stderr
    name = "fine-bodies-2-position-z-energy-all.png"
    assert result.stdout == f"{name}: 4 curves, Position [m], Energy [J]\n"
    assert result.stderr == ""
    assert (here / name).read_bytes().startswith(b"\x89PNG")
    assert os.listdir(here) == [name]


def test_svg_has_its_words_as_text(files, here):
    result = call(*files, "requests/7/F2", "bodies/3/position/z", "-o", "words.SVG")
    assert result.exit_code == 0, result.stderr
    text = (here / "words.SVG").read_text(encoding="utf-8")
    for said in (
        "fine: body 3 (high), z",
        # a label's own letters, no formula
        "coarse: request 7 (top $1_x), F2 = x",
        "Displacement [m]",
        "Position [m]",
        "Time [s]",
        ">fine, coarse<",
        "tol 1e-09",
    ):
        assert said in text
    again = call(*files, "requests/7/F2", "bodies/3/position/z", "-o", "again.svg")
    assert again.exit_code == 0
    assert (here / "again.svg").read_text(encoding="utf-8") == text


def test_json(files, here):
    result = call(files[0], "bodies/2/position/z", "-o", "a.png", "--json")
    said = json.loads(result.stdout)
    assert said["picture"] == "a.png"
    assert said["panels"] == [
        {
            "quantity": "Position",
            "unit": "m",
            "curves": [
                {"file": "fine", "name": "bodies/2/position/z", "label": "body 2, z", "rows": 31}
            ],
        }
    ]


def test_only_pictures_are_replaced(files, here):
    (here / "notes.png").write_text("my notes")
    result = call(files[0], "energy/kinetic", "-o", "notes.png")
    assert result.exit_code == 2
    assert "is there and is no picture; it is left alone" in result.stderr
    assert (here / "notes.png").read_text() == "my notes"
    for _ in range(2):
        assert call(files[0], "energy/kinetic", "-o", "a.png").exit_code == 0
        assert call(files[0], "energy/kinetic", "-o", "a.svg").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["bodies/2/positon/z"], 2, "no signal 'bodies/2/positon/z'; did you mean bodies/2/posi"),
        (["bodies/2/positon/z"], 2, "there is bodies/{2,3}/acceleration, bodies/{2,3}/angular"),
        (["bodies/2/position/q"], 2, "bodies/2/position has x, y, z, mag"),
        (["bodies/2"], 2, "is a group, not a signal; it has acceleration, angular_velocity"),
        (["bodies/9*/position"], 2, "no signal 'bodies/9*/position'"),
        (["events"], 2, "events is no signal over time; there is bodies"),
        (["state/y"], 2, "state/y is no signal over time"),
        (["7.F3"], 2, "did you mean requests/7/F3?"),
        (["Force_Contact[301].force"], 2, "names with Force_Contact[ID]. are for mbsim request"),
        (["contacts/301/peak_force"], 2, "peak_force is no signal over time"),
        ([], 2, "no signal named; "),
        (["energy/kinetic", "-o", "a.pdf"], 2, "must end in .png or .svg"),
        (["energy/kinetic", "-o", "no/a.png"], 5, "no/a.png: the picture cannot be written"),
        (["energy/kinetic", "--events", "--x", "energy/potential"], 2, "--events goes with"),
        (["none.h5", "energy/kinetic"], 2, "none.h5: no such file"),
    ],
)
def test_what_is_wrong_is_one_line(files, here, arguments, code, said):
    result = call(files[0], *arguments)
    assert result.exit_code == code
    assert result.stderr.startswith("mbsim: error: ")
    assert result.stderr.count("\n") == 1
    assert said in result.stderr
    assert os.listdir(here) == []


def test_no_file_is_named(here):
    result = call("bodies/2/position")
    assert result.exit_code == 2
    assert "no result file given" in result.stderr


def test_without_matplotlib(files, here, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = call(files[0], "energy/kinetic")
    assert result.exit_code == 2
    assert result.stderr == (
        "mbsim: error: plot needs matplotlib, which is not installed: pip install matplotlib\n"
    )


def test_the_users_matplotlib_settings_change_nothing(files, here):
    import matplotlib

    plain = call(files[0], "energy/kinetic", "-o", "plain.svg")
    with matplotlib.rc_context({"font.size": 30, "svg.fonttype": "path", "lines.color": "red"}):
        other = call(files[0], "energy/kinetic", "-o", "other.svg")
        assert matplotlib.rcParams["font.size"] == 30
    assert (plain.exit_code, other.exit_code) == (0, 0)
    assert (here / "plain.svg").read_bytes() == (here / "other.svg").read_bytes()


def test_letters_that_the_font_lacks_are_said(files, here):
    drawn = picture(files[0], names=("energy/kinetic",))
    drawn.title = "\u7403"
    assert save(draw(drawn), here / "a.png") == [
        "the font of the picture lacks letters of some labels"
    ]
    assert (here / "a.png").is_file()


def test_run_and_info_import_no_matplotlib(files, tmp_path):
    deck = write_deck(tmp_path, DECK, end_time=0.05)
    code = (
        "import sys; from mbsim.cli.main import main\n"
        f"main(['run', {str(deck)!r}, '-o', {str(tmp_path)!r}], standalone_mode=False)\n"
        f"main(['info', {str(files[0])!r}], standalone_mode=False)\n"
        "print('matplotlib' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(PACKAGES)},
    )
    assert done.stdout.splitlines()[-1] == "False", done.stderr


def test_info_lists_names_with_parts_and_units(files):
    shown = CliRunner().invoke(main, ["info", str(files[0])]).stdout
    assert re.search(r"bodies/\{2,3\}/position +/x /y /z /mag +m\n", shown)
    assert re.search(r"requests/7 +/F1 .* /F8 +m, rad\n", shown)
    assert re.search(r"requests/8 +/F1 .* /F8 +m/s, rad/s\n", shown)
    assert re.search(r"energy/kinetic +J\n", shown)
    assert "other data\n" in shown


# --- names and units -------------------------------------------------------------------------


def test_patterns_fit_segment_by_segment():
    columns = {"bodies/2/velocity": 3, "bodies/10/velocity": 3, "requests/3": 8, "time": 1}
    assert matching("bodies/*/velocity/mag", columns) == [
        "bodies/2/velocity/mag",
        "bodies/10/velocity/mag",
    ]
    assert matching("requests/*/F[12]", columns) == ["requests/3/F1", "requests/3/F2"]
    assert matching("bodies/?/velocity", columns) == ["bodies/2/velocity"]
    assert matching("*", columns) == ["time"]
    assert matching("bodies/*", columns) == []


def test_compact_names():
    few = [f"bodies/{k}/position" for k in (10, 2)]
    many = [f"contacts/{k}/force" for k in range(1, 9)]
    assert compact([*few, *many, "time"]) == {
        "bodies/{2,10}/position": ["bodies/2/position", "bodies/10/position"],
        "contacts/*/force": many,
        "time": ["time"],
    }
    # names of different kinds stand apart, and a * would stand for both
    kinds = {name: "even" if int(name[9]) % 2 == 0 else "odd" for name in many}
    assert list(compact(many, kinds)) == ["contacts/{1,3,5,7}/force", "contacts/{2,4,6,8}/force"]
    assert list(compact(many, dict.fromkeys(many[:7], "a") | {many[7]: "b"})) == [
        "contacts/{1,2,3,4,5,6}/force",
        "contacts/7/force",
        "contacts/8/force",
    ]


def test_names_of_files_are_as_long_as_needed():
    assert names_of([Path("a/ball.h5"), Path("b/box.h5")]) == ["ball", "box"]
    # of one model in two folders the folders say it
    assert names_of([Path("a/ball.h5"), Path("b/ball.h5")]) == ["a", "b"]
    both = [Path("a/ball.h5"), Path("b/ball.h5"), Path("b/box.h5")]
    assert names_of(both) == ["a/ball", "b/ball", "b/box"]
    assert names_of([Path("ball.h5"), Path("b/ball.h5")]) == ["ball", "b"]
    assert names_of([Path("ball.h5"), Path("ball.h5")]) == ["ball", "ball"]


def test_units():
    si, inches = UnitSystem(), UnitSystem("POUND_FORCE", "INCH", "MILLISECOND")
    acceleration = Quantity("Acceleration", length=1, time=-2)
    assert (si.text(TIME), inches.text(TIME)) == ("s", "ms")
    assert inches.text(acceleration) == "in/ms²"
    assert si.text(Quantity("Angular velocity", time=-1, angle=1)) == "rad/s"
    assert si.text(Quantity("Torque", force=1, length=1)) == "N·m"
    assert si.text(Quantity("Rate", time=-1)) == "1/s"
    # 1 in/ms^2 = 0.0254 m / 1e-6 s^2
    assert inches.factor_to(si, acceleration) == pytest.approx(25400.0, rel=1e-15)
    # 1 lbf in = 4.4482216152605 N 0.0254 m
    torque = inches.factor_to(si, Quantity("Torque", force=1, length=1))
    assert torque == pytest.approx(4.4482216152605 * 0.0254, rel=1e-15)


def test_every_measure_of_a_request_has_its_quantity():
    measures = {*requests._MEASURES, *(m for type in TYPES.values() for m in type.measures)}
    assert measures == set(quantities._BY_MEASURE)


def test_a_shell_completes_the_names_of_signals(tmp_path):
    file = run_balls(tmp_path)
    shell = ShellComplete(main, {}, "mbsim", "_MBSIM_COMPLETE")

    def completed(*words):
        return [item.value for item in shell.get_completions(list(words[:-1]), words[-1])]

    assert completed("plo") == ["plot", "plot-law"]
    assert [item.type for item in shell.get_completions(["plot"], "x")] == ["file"]
    assert "bodies/" in completed("plot", str(file), "bod")
    assert "bodies/2/" in completed("plot", str(file), "bodies/")
    assert {"bodies/2/position", "bodies/2/position/"} <= set(
        completed("plot", str(file), "bodies/2/pos")
    )
    assert completed("plot", str(file), "bodies/2/position/") == [
        f"bodies/2/position/{part}" for part in ("x", "y", "z", "mag")
    ]
