"""The benchmark: its arithmetic on made-up numbers, its references, and one scene end to end."""

from __future__ import annotations

import csv
import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from helpers.folders import SHARED
from mbsim.bench import linkages, oracle, peers, plot, report, runner
from mbsim.bench import ours as own
from mbsim.bench import parameters as p
from mbsim.bench.front import Point, compare, front, own_fronts, time_at, winner
from mbsim.bench.measurement import OURS, Measurement, measured
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import pybullet
from mbsim.bench.scene import Scene, Target
from mbsim.bench.scenes import all_scenes, s01_top, s03_rolling, s07_grains, s10_hard_ball
from mbsim.cli.main import main
from mbsim.integrators.catalog import METHODS
from mbsim.model.frames import marker_frames
from mbsim.reader.xml import read_model

REFERENCES = SHARED / "references.json"
MACHINE = {"date": "2026-01-01", "cpu": "none", "python": "3"}


def scene(**changes):
    """Return a scene whose only measure is `error`."""
    values = {
        "name": "T",
        "title": "made up",
        "end_time": 2.0,
        "measure": "error",
        "unit": "1",
        "deck": lambda variation: "",
        "errors": lambda outcome, variant: {"error": 0.5},
    }
    return Scene(**(values | changes))


def row(engine, error, time, setting="s", **errors):
    """Return a measurement of the made-up scene."""
    found = {} if math.isnan(error) else {"error": error, **errors}
    return Measurement("T", engine, "1", setting, 3, 2.0 * time, time, found, {"steps": 7.0}, "")


def outcome(wall_s=0.1, end_time=2.0, note=""):
    """Return an outcome of one body at rest."""
    time = np.linspace(0.0, end_time, 5)
    nothing = np.zeros((5, 1, 3))
    turn = np.zeros((5, 1, 4))
    turn[..., 0] = 1.0
    return Outcome(wall_s, time, nothing, turn, nothing, nothing, {}, note)


def ours(*pairs):
    """Return points of ours."""
    return [Point(error, time, OURS, "s") for error, time in pairs]


# --- fronts


def test_front_keeps_what_nothing_beats():
    kept = front(ours((1e-2, 1.0), (1e-3, 2.0), (5e-3, 3.0), (1e-4, 2.5), (2e-2, 0.5)))
    assert [point.error for point in kept] == [2e-2, 1e-2, 1e-3, 1e-4]


def test_time_is_interpolated_in_logarithms_and_never_extrapolated():
    line = front(ours((1e-2, 1.0), (1e-4, 100.0)))
    assert time_at(line, 1e-3) == pytest.approx(10.0)
    assert time_at(line, 1e-2) == 1.0
    assert time_at(line, 1e-4) == pytest.approx(100.0)
    # a looser error is reached by the cheapest run, which is better than asked
    assert time_at(line, 0.5) == 1.0
    assert time_at(line, 9e-5) is None
    assert time_at([], 1.0) is None


def test_an_exact_run_is_not_interpolated():
    assert time_at(front(ours((1e-2, 1.0), (0.0, 3.0))), 1e-3) == 3.0


def test_targets_are_met_lost_or_not_reached():
    rows = [row(OURS, 1e-3, 0.04), row(OURS, 1e-5, 0.4)]
    rows += [row("a", 5e-3, 1.0), row("b", 1e-5, 2.0), row("a", 1e-6, 9.0), row("a", 0.5, 0.01)]
    cells = compare(scene(targets=(Target(1 / 20, up_to=1e-4), Target(1 / 2))), rows)
    assert [(cell.error, cell.met) for cell in cells] == [
        (5e-3, True),
        (1e-5, False),
        (1e-6, False),
    ]
    assert cells[0].ratio == pytest.approx(0.04)
    assert cells[1].target == 1 / 20
    assert cells[1].ratio == pytest.approx(0.2)
    assert cells[2].ours_s is None
    shown = report.comparison(cells)
    assert "1/25" in shown
    assert "not reached" in shown


def test_a_peer_that_stores_fewer_rows_is_not_compared():
    rows = [row(OURS, 1e-3, 1.0), row("b", 1e-3, 3.0)]
    rows.append(row("a", 1e-3, 2.0)._replace(counts={"rows_ms": 50.0}))
    assert [cell.peer for cell in compare(scene(), rows)] == ["b"]
    text = report.markdown(MACHINE, [scene()], rows, [], [])
    assert "- T, a, 1 settings: rows 50 ms apart, 10 asked" in text
    assert "not compared: rows 50 ms apart" in report.line(scene(), rows[2])
    # a scene may ask for fewer rows
    assert [cell.peer for cell in compare(scene(sample=0.05), rows)] == ["a"]


def test_a_run_that_was_cut_short_is_not_compared():
    rows = [row(OURS, 0.01, 2.0), row("a", 0.02, 1.0)._replace(counts={"reached_s": 0.5})]
    assert compare(scene(pass_below=0.05), rows) == []
    assert "cut short" in report.markdown(MACHINE, [scene()], rows, [], [])


def test_ours_may_be_held_to_a_measure_of_its_own():
    made = scene(own_measure="law", targets=(Target(1 / 2),))
    rows = [row(OURS, 1e-3, 1.0, law=1e-6), row("a", 1e-4, 4.0)]
    judged, beside = compare(made, rows)
    assert (judged.held_to, judged.ratio, judged.met) == ("law", 0.25, True)
    # against the peers' own measure our error is too large; that is shown and not judged
    assert (beside.held_to, beside.ratio, beside.target, beside.met) == ("error", None, None, None)
    assert "| error " in report.comparison([beside])
    assert "law 1e-06" in report.line(made, rows[0])


def test_without_target_or_without_our_run_nothing_is_judged():
    rows = [row(OURS, 1e-3, 1.0), row("a", 1e-3, 1.0)]
    assert compare(scene(), rows)[0].met is None
    assert compare(scene(targets=(Target(0.5),)), rows[1:])[0].met is None
    assert compare(scene(), rows[:1]) == []


def test_a_threshold_compares_the_fastest_runs_below_it():
    rows = [row(OURS, 0.2, 0.1), row(OURS, 0.01, 2.0), row("a", 0.3, 0.5), row("b", 0.049, 4.4)]
    (cell,) = compare(scene(targets=(Target(1 / 2),), pass_below=0.05), rows)
    assert (cell.peer, cell.peer_s, cell.ours_s, cell.met) == ("b", 4.4, 2.0, True)


# --- measurements


def test_long_runs_are_not_repeated():
    asked = []

    def run(count):
        asked.append(count)
        return outcome(wall_s=5.0 if len(asked) == 1 else 0.1)

    assert measured(scene(), "a", "1", "s", run, 5).repeats == 1
    assert measured(scene(), "a", "1", "s", run, 5).repeats == 5
    assert asked == [1, 1, 5]


def test_short_runs_are_repeated_more_often():
    short = measured(scene(), "a", "1", "s", lambda count: outcome(wall_s=1e-3), 5)
    assert short.repeats == 15
    assert measured(scene(), "a", "1", "s", lambda count: outcome(wall_s=1e-3), 1).repeats == 1


def test_a_run_that_ended_early_is_not_judged():
    early = measured(scene(), "a", "1", "s", lambda count: outcome(end_time=1.0), 1)
    assert early.errors == {}
    assert "ended at 1 s" in early.note
    assert early.counts == {"rows_ms": 250.0, "reached_s": 1.0}
    assert measured(scene(), "a", "1", "s", lambda count: outcome(), 1).wall_per_sim_s == 0.05


def test_a_note_names_the_variant_of_the_law():
    s2b = all_scenes()["S2b"]
    assert s2b.variant("") == "linear"
    assert s2b.variant("linear_noclip: springs in series") == "linear_noclip"
    assert s2b.variant("mujoco, soft constraint") == "mujoco"


def test_a_peer_that_fails_has_a_line(tmp_path, monkeypatch):
    def broken(scene, setting, count):
        raise RuntimeError("no convergence\nand more")

    engine = SimpleNamespace(version=lambda: "9", settings=lambda scene: ["x"], run=broken)
    monkeypatch.setattr(peers, "load", lambda name: engine)
    made_up = scene(deck=s10_hard_ball.SCENES[0].deck)
    options = runner.Options([made_up], ["DOPRI5"], [1e-3], 1, ["mujoco"])
    done = runner.run(options, tmp_path, lambda line: None)
    assert done.rows[-1].note == "failed: no convergence"
    assert done.cells == []
    # a deck of 1 s in a scene of 2 s: not judged either
    text = report.markdown(done.machine, [made_up], done.rows, done.cells, [])
    assert "- T, mujoco, 1 settings: failed: no convergence" in text


# --- files


def test_csv_has_one_line_a_run_and_empty_cells_for_what_is_not_there(tmp_path):
    rows = [row(OURS, 1e-3, 0.5, second=2.0), row("a", math.nan, math.nan)]
    report.write_csv(tmp_path / "bench.csv", MACHINE, [scene()], rows)
    with (tmp_path / "bench.csv").open(encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    assert list(first) == [
        *report.FIRST_COLUMNS,
        *("measure", "error", "second", "steps"),
        *report.LAST_COLUMNS,
    ]
    assert (first["wall_s"], first["error"], first["second"]) == ("1", "0.001", "2")
    assert (second["wall_s"], second["error"], second["cpu"]) == ("", "", "none")


def test_table_lines_up():
    lines = report.table(("a", "long"), [("1", "2"), ("333", "4")]).splitlines()
    assert lines[1] == "|-----|------|"
    assert len({len(line) for line in lines}) == 1


# --- references


def test_first_impacts_are_those_of_the_parameters():
    for variant, (start, speed_in, speed_out) in p.S2_FIRST_IMPACT.items():
        flight, touch, after = oracle.s2(variant).phases[:3]
        assert touch.start == pytest.approx(start, abs=1e-14)
        assert flight.velocity - p.GRAVITY * touch.start == pytest.approx(-speed_in, abs=1e-12)
        assert after.velocity == pytest.approx(speed_out, abs=1e-9)


def test_heights_are_continuous_where_phases_meet():
    bounces = oracle.s2("impact")
    meets = np.array([phase.start for phase in bounces.phases[1:]])
    assert np.abs(bounces.height(meets)).max() < 1e-12
    assert np.abs(bounces.height(np.nextafter(meets, 0.0))).max() < 1e-12


def test_rebound_of_the_hard_ball():
    # e = exp(-pi zeta / sqrt(1 - zeta^2)) without weight and clipping, which change it by 1e-6
    for variant in oracle.S10A_FORCES:
        assert oracle.s10a_rebound(variant) == pytest.approx(p.S10A_RESTITUTION**2, abs=2e-5)


def test_rolling_tends_to_rigid_friction():
    # a smoothing of 0.02 m/s adds 2/7 of the way slipped late: 4.3e-6 m
    late = 0.02**2 / (3.5 * p.S3.mu * p.GRAVITY)
    late *= math.log((math.sqrt(3.0) + 1.0) / (math.sqrt(3.0) - 1.0)) / math.sqrt(3.0) - 0.5
    x = s03_rolling.law_solution(p.S3.radius)
    assert x - p.S3.end_x == pytest.approx(2.0 / 7.0 * late, rel=1e-4)


@pytest.mark.skipif(not REFERENCES.is_file(), reason=f"no reference data at {REFERENCES}")
def test_references_are_those_of_the_shared_file():
    shared = json.loads(REFERENCES.read_text(encoding="utf-8"))
    for top, name in ((p.S1, "S1"), (p.S10C, "S10c")):
        assert (
            s01_top.attitude_error(np.array(shared[name]["q"]), np.array(top.end_quaternion))
            < 1e-15
        )
    times = np.array(shared["S2"]["t"])
    for variant in p.S2_FIRST_IMPACT:
        heights = np.array(shared["S2"][variant]["z"])
        assert np.abs(oracle.s2(variant).height(times) - heights).max() < 1.5e-8
    assert shared["S3"]["x_end"] == pytest.approx(p.S3.end_x, abs=1e-14)
    assert shared["S5"]["v"] == pytest.approx(p.S5.end_v, abs=1e-14)
    assert shared["S10"]["a_e"] == pytest.approx(p.S10A_RESTITUTION, abs=1e-14)


# --- error measures


def test_angle_between_attitudes():
    half = 0.5 * 1e-9
    turned = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
    unit = np.array([1.0, 0.0, 0.0, 0.0])
    assert s01_top.attitude_error(turned, unit) == pytest.approx(1e-9, rel=1e-9)
    assert s01_top.attitude_error(-turned, unit) == pytest.approx(1e-9, rel=1e-9)
    assert s01_top.attitude_error(np.array([0.0, 1.0, 0.0, 0.0]), unit) == pytest.approx(math.pi)


def test_apex_between_rows_is_met():
    time = np.arange(101) * 0.01
    height = 0.49 - 0.5 * p.GRAVITY * (time - 0.6371) ** 2
    flight = outcome()._replace(time=time, position=np.zeros((101, 1, 3)))
    flight.position[:, 0, 2] = height + p.S10A.radius
    assert s10_hard_ball.rebound(flight) == pytest.approx(0.98, abs=1e-12)


def test_deepest_of_spheres_floor_and_walls():
    r = p.S7.radius
    apart = np.array([[0.0, 0.0, 2 * r], [0.0, 0.0, 5 * r]])
    assert s07_grains.deepest(apart, 1.0) == 0.0
    near = np.array([[0.0, 0.0, 2 * r], [0.0, 1.9 * r, 2 * r]])
    assert s07_grains.deepest(near, 1.0) == pytest.approx(0.1)
    assert s07_grains.deepest(apart - np.array([0.0, 0.0, 1.3 * r]), 1.0) == pytest.approx(0.3)
    assert s07_grains.deepest(apart + np.array([0.5, 0.0, 0.0]), 0.5 + 0.8 * r) == pytest.approx(
        0.2
    )


def test_peaks_of_all_steps_count_beside_the_rows():
    r = p.S7.radius
    rest = outcome()._replace(position=np.tile([0.0, 0.0, 0.99 * r], (5, 1, 1)))
    errors = s07_grains._errors(1, rest._replace(extra={"peak_penetration": 0.03 * r}), "")
    assert errors["pen_rows_over_r"] == pytest.approx(0.01)
    assert errors["pen_max_over_r"] == pytest.approx(0.03)
    assert s07_grains._errors(1, rest, "")["pen_max_over_r"] == pytest.approx(0.01)


# --- our settings and the growth with the number of spheres


@pytest.mark.parametrize("name", ["S7_1000", "drum_300"])
def test_moreau_runs_once_for_all_stiffnesses_and_once_for_each_step(name):
    scene = all_scenes()[name]
    those = [s for s in own.settings(scene, ["MOREAU"], [1e-2])]
    steps = {v["h"] for v in scene.variations if "h" in v}
    assert sum("h" not in s.variation for s in those) == 1
    assert sorted(s.variation["h"] for s in those if "h" in s.variation) == sorted(steps)
    stiffnesses = {v["k"] for v in scene.variations}
    others = own.settings(scene, ["VERLET"], [1e-2])
    assert {s.variation["k"] for s in others} == stiffnesses
    assert len(stiffnesses) > 1


def test_integrators_are_those_of_the_scene_unless_asked_for():
    scenes = all_scenes()

    def used(name, *asked):
        return {s.integrator for s in own.settings(scenes[name], asked, [])}

    joined = set(METHODS) - {"VERLET"}
    assert used("S2a") == used("S1") == used("S7_125") == used("S7_1000") == set(METHODS)
    assert used("S8_2") == used("S11_lugre") == joined
    assert used("S7_8000") == {"VERLET"}
    assert used("S7_1000", "DOPRI5") == {"DOPRI5"}
    assert runner.choose_integrators([]) == []
    assert runner.choose_integrators(["verlet"]) == ["VERLET"]
    texts = [setting.text for setting in own.settings(scenes["S7_1000"], [], [])]
    assert "VERLET tol=0.001 k=200000" in texts
    assert {s.tol for s in own.settings(scenes["S7_1000"], [], [])} == {1e-1, 2e-2, 1e-2, 1e-3}


def grains(bodies, wall_s, setting="VERLET tol=0.001"):
    """Return a run of S7 with 100 steps and as many contacts as bodies."""
    counts = {"steps": 100.0, "rhs_evaluations": 200.0, "normal_calls": 200.0 * bodies}
    errors = {"pen_max_over_r": 0.01}
    name = f"S7_{bodies}"
    return Measurement(name, OURS, "1", setting, 1, wall_s, 0.5 * wall_s, errors, counts, "")


def test_growth_with_the_number_of_spheres():
    # per body or contact and step: 0.025 / (100 * 250) = 1000 ns
    few, some, many = grains(125, 0.025), grains(1000, 0.3), grains(8000, 2.4)
    shown = report.scaling([few, some, many, grains(125, 0.025, "DOPRI5 tol=0.001")])
    first, second = shown.splitlines()[2:]
    assert [cell.strip() for cell in first.split("|")[2:-1]] == [
        *("1000", "1500", "1500"),
        *("1.50", "1.5", "met"),
    ]
    assert [cell.strip() for cell in second.split("|")[2:-1]] == ["1000", *[""] * 5]
    assert "lost" in report.scaling([few, grains(8000, 2.6)])
    assert report.scaling([row(OURS, 1e-3, 1.0)]) == ""


def chain(rods, wall_s, evaluations, setting="DOPRI5 tol=1e-06"):
    """Return a run of ours of S8 with so many rods."""
    counts = {"rhs_evaluations": evaluations - 200.0, "output_evaluations": 200.0}
    name = f"S8_{rods}"
    return Measurement(name, OURS, "1", setting, 1, wall_s, wall_s / 2, {"e": 1.0}, counts, "")


def test_growth_of_an_evaluation_with_the_length_of_a_chain():
    shown = report.chain_growth([chain(10, 2e-3, 2000), chain(40, 18e-3, 4000)])
    (line,) = shown.splitlines()[2:]
    assert [cell.strip() for cell in line.split("|")[2:-1]] == ["1000", "4500", "4.50", "5", "met"]
    assert "lost" in report.chain_growth([chain(10, 2e-3, 2000), chain(40, 21e-3, 4000)])
    assert report.chain_growth([grains(125, 0.025)]) == ""


METHOD_RUNS = [
    row(OURS, 1e-2, 1.0, "A tol=0.01"),
    row(OURS, 1e-4, 100.0, "A tol=0.0001"),
    row(OURS, 2e-2, 4.0, "B tol=0.01"),
    row(OURS, 1e-6, 16.0, "B tol=0.0001"),
    row("peer", 1e-9, 1e-3, "C fast"),
]


def test_the_first_of_our_methods_is_told_by_error():
    each = own_fronts(scene(), METHOD_RUNS)
    assert {name: len(points) for name, points in each.items()} == {"A": 2, "B": 2}
    assert winner(each, 1e-1) == ("A", pytest.approx(4.0))
    name, factor = winner(each, 1e-4)
    assert name == "B"
    assert factor == pytest.approx(100.0 / time_at(each["B"], 1e-4))
    assert winner(each, 1e-6) == ("B", math.inf)
    assert winner(each, 1e-7) is None


def test_report_says_which_method_is_first_at_each_decade():
    (line,) = report.winners([scene()], METHOD_RUNS).splitlines()[2:]
    cells = [cell.strip() for cell in line.split("|")[2:-1]]
    assert cells[0].startswith("A ")
    assert cells[0].endswith("x")
    assert cells[-2:] == ["B only", ""]
    (line,) = report.winners([scene()], METHOD_RUNS[:2]).splitlines()[2:]
    assert [cell.strip() for cell in line.split("|")[2:-1]] == ["A", "A", "A", "", "", ""]


def test_our_methods_have_one_colour_each():
    assert len({plot.own_colour(name) for name in METHODS}) == len(METHODS)


def test_the_picture_shows_where_each_method_is_first(tmp_path, monkeypatch):
    from matplotlib.axes import Axes

    strip, real = [], Axes.axvspan
    monkeypatch.setattr(
        Axes,
        "axvspan",
        lambda self, left, right, **style: (
            strip.append((left, right, style["color"])),
            real(self, left, right, **style),
        )[1],
    )
    monkeypatch.setattr(plot, "own_colour", {"A": "tab:red", "B": "tab:blue"}.get)
    plot.draw(scene(), METHOD_RUNS, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 0
    each = own_fronts(scene(), METHOD_RUNS)
    colours = {"A": "tab:red", "B": "tab:blue"}
    assert {colour for *_, colour in strip} == set(colours.values())
    for left, right, colour in strip:
        assert colour == colours[winner(each, math.sqrt(left * right))[0]]


def test_tighter_runs_are_left_out_after_a_long_one():
    ladders = own.Ladders(5.0)
    assert ladders.too_long(own.Setting("A", -1.0, {})) == ""
    ladders.note(own.Setting("A", 1e-3, {}), 4.0)
    assert ladders.too_long(own.Setting("A", 1e-4, {})) == ""
    ladders.note(own.Setting("A", 1e-4, {}), 6.0)
    assert ladders.too_long(own.Setting("A", 1e-4, {"k": 2.0})) == ""
    assert ladders.too_long(own.Setting("B", 1e-9, {})) == ""
    assert ladders.too_long(own.Setting("A", 1e-5, {})) == (
        "left out: A took 6 s at a looser tolerance"
    )
    ladders.note(own.Setting("B", 1e-2, {}), math.inf)
    assert "given up at this tolerance" in ladders.too_long(own.Setting("B", 1e-2, {"k": 2.0}))
    assert "given up at a looser" in ladders.too_long(own.Setting("B", 1e-3, {}))


def test_runs_that_are_left_out_have_a_line_unless_tolerances_are_asked_for(tmp_path):
    quick = replace(all_scenes()["S4stick"], end_time=0.05, patience=0.0, limit=20.0)
    quick = replace(quick, integrators=("DOPRI5",), tolerances=(1e-3, 1e-5))
    rows = list(own.measure(quick, (), (), 1, tmp_path))
    notes = [each.note for each in rows if "tol=1e-05" in each.setting]
    assert notes
    assert all(note.startswith("left out: DOPRI5 took") for note in notes)
    assert not any(each.note.startswith("left out") for each in rows if "tol=0.001" in each.setting)
    rows = own.measure(quick, (), (1e-3, 1e-5), 1, tmp_path)
    assert not any(each.note.startswith("left out") for each in rows)


def test_a_faulty_deck_is_left_to_every_method():
    assert own.able("<MotionSolve/>") == tuple(METHODS)


def test_a_scene_says_at_which_errors_it_is_compared():
    mine = [row(OURS, 1e-9, 1.0, "fine"), row(OURS, 1e-2, 0.1)]
    theirs = [row("peer", 5e-3, 1.0, "a"), row("peer", 5e-8, 2.0, "b")]
    assert [cell.setting for cell in compare(scene(), mine + theirs)] == ["a"]
    fine = scene(compared=(1e-9, 1e-3))
    assert [cell.setting for cell in compare(fine, mine + theirs)] == ["b"]


# --- linkages


def swung(count):
    """Return an outcome of S8_n from its own reference, with the reference's rates."""
    end_time = p.S8.end_time[count]
    start = np.zeros(2 * count)
    states = oracle.sampled(oracle.chain_rate(count), start, end_time)
    poses = linkages.chain(states[:, :count], states[:, count:])
    return Outcome(1.0, np.arange(len(states)) * p.SAMPLE, *poses, {}, "")


def test_errors_of_a_chain_that_follows_its_reference():
    done = swung(2)
    made = all_scenes()["S8_2"]
    errors = made.errors(done, "")
    assert max(errors[name] for name in ("tip_max", "tip_rms", "tip_end", "joint_drift")) < 1e-14
    assert errors["E_rel"] < 1e-12  # the equations of motion keep the energy of the bodies
    moved = done._replace(position=done.position + np.array([0.0, 0.0, 1e-6]))
    errors = made.errors(moved, "")
    assert errors["tip_max"] == pytest.approx(1e-6, rel=1e-6)
    assert errors["joint_drift"] == pytest.approx(1e-6, rel=1e-6)


def test_errors_of_a_crank_that_follows_its_reference():
    s = p.S8B
    crank, rate = oracle.sampled(oracle.crank_rate, np.array([s.angle, s.speed]), s.end_time).T
    rod = -np.arcsin(s.crank_length / s.rod_length * np.sin(crank))
    rod_rate = -s.crank_length * np.cos(crank) * rate / (s.rod_length * np.cos(rod))
    slider = s.crank_length * np.cos(crank) + s.rod_length * np.cos(rod)
    speed = -s.crank_length * np.sin(crank) * rate - s.rod_length * np.sin(rod) * rod_rate
    poses = linkages.slider_crank(
        np.stack([crank, rod], axis=1), np.stack([rate, rod_rate], axis=1), slider, speed
    )
    done = Outcome(1.0, np.arange(len(crank)) * p.SAMPLE, *poses, {}, "")
    errors = all_scenes()["S8b"].errors(done, "")
    assert errors["crank_angle_max"] < 1e-13
    assert errors["loop_gap"] < 1e-15
    moved = done._replace(position=done.position + np.array([0, 0, 1.0])[:, None] * [0.0, 1e-7, 0])
    assert all_scenes()["S8b"].errors(moved, "")["loop_gap"] == pytest.approx(1e-7)
    # the bodies' own energy is constant, which the one equation of motion does not know
    across = [p.rod_inertia(s.crank_mass, s.crank_length)[1]]
    across += [p.rod_inertia(s.rod_mass, s.rod_length)[1], 0.0]
    mass = np.array([s.crank_mass, s.rod_mass, s.slider_mass])
    kinetic = mass * (done.velocity**2).sum(axis=2) + across * done.angular_velocity[..., 1] ** 2
    energy = (kinetic / 2 + mass * p.GRAVITY * done.position[..., 2]).sum(axis=1)
    assert np.ptp(energy) < 1e-11 * energy[0]


@pytest.mark.skipif(not REFERENCES.is_file(), reason=f"no reference data at {REFERENCES}")
@pytest.mark.parametrize("count", [2, 10, pytest.param(40, marks=pytest.mark.slow)])
def test_free_end_is_that_of_the_shared_file(count):
    shared = json.loads(REFERENCES.read_text(encoding="utf-8"))[f"S8_{count}"]
    tip = np.stack([shared["tip_x"], shared["tip_z"]], axis=1)
    assert np.abs(oracle.s8_tip(count) - tip).max() < 2e-11


@pytest.mark.skipif(not REFERENCES.is_file(), reason=f"no reference data at {REFERENCES}")
def test_crank_angle_is_that_of_the_shared_file():
    shared = json.loads(REFERENCES.read_text(encoding="utf-8"))["S8b"]
    assert np.abs(oracle.s8b_angle() - shared["th"]).max() < 2e-11


@pytest.mark.parametrize("name", ["S8_2", "S8_10", "S8b"])
def test_joints_are_closed_at_the_start(tmp_path, name):
    from lxml import etree

    root = etree.fromstring(all_scenes()[name].deck({}).encode())
    joints = root.findall("Model/Constraint_Joint")
    for statement in joints:
        statement.getparent().remove(statement)
    (tmp_path / "bodies.xml").write_bytes(etree.tostring(root))
    deck = read_model(tmp_path / "bodies.xml")
    frames = marker_frames(deck)
    bodies = {body.id: body for body in deck.bodies.values()}

    def speed(marker_id):
        body = bodies[deck.markers[marker_id].body_id]
        if body.is_ground:
            return np.zeros(3)
        arm = frames[marker_id].p - frames[body.cg_id].p
        w, v = (np.array([x or 0.0 for x in rate]) for rate in (body.w_ic, body.v_ic))
        return v + np.cross(w, arm)

    assert len(joints) == {"S8_2": 2, "S8_10": 10, "S8b": 4}[name]
    for statement in joints:
        i, j = int(statement.get("i_marker_id")), int(statement.get("j_marker_id"))
        assert frames[i].R == pytest.approx(frames[j].R, abs=1e-15)
        apart, slip = frames[i].p - frames[j].p, speed(i) - speed(j)
        if statement.get("type") == "TRANSLATIONAL":  # free along z of J
            axis = frames[j].R[:, 2]
            apart, slip = np.cross(axis, apart), np.cross(axis, slip)
        assert apart == pytest.approx(np.zeros(3), abs=1e-15)
        assert slip == pytest.approx(np.zeros(3), abs=1e-14)


# --- whole runs


def test_every_scene_writes_xml():
    from lxml import etree

    for made in all_scenes().values():
        for variation in made.variations:
            root = etree.fromstring(made.deck(variation).encode())
            said = float(root.find("Command/Simulate").get("end_time"))
            assert said == made.end_time


def test_walls_of_the_grains_look_inward(tmp_path):
    text = all_scenes()["S7_125"].deck({"k": 1e5})
    planes = text[: text.index('<Body_Rigid id="2"')] + "</Model></MotionSolve>"
    (tmp_path / "walls.xml").write_text(planes, encoding="utf-8")
    frames = marker_frames(read_model(tmp_path / "walls.xml"))
    for marker in range(11, 15):
        side, normal = frames[marker].p, frames[marker].R[:, 2]
        assert normal @ side == pytest.approx(-p.s7_half_width(125))


def call(*arguments):
    return CliRunner().invoke(main, ["bench", *map(str, arguments)])


def test_a_scene_end_to_end(tmp_path):
    done = call(
        *("S10a", "--no-peers", "--tol", "1e-3,1e-8", "--integrator", "DOPRI5"),
        *("--repeats", 1, "-o", tmp_path / "out", "--json"),
    )
    assert done.exit_code == 0, done.stderr
    said = json.loads(done.stdout)
    loose, tight = said["rows"]
    assert tight["errors"]["rebound_error"] < 1e-7 < loose["errors"]["rebound_error"] < 1e-2
    assert tight["errors"]["rebound_over_drop"] == pytest.approx(0.99686, abs=1e-5)
    assert said["cells"] == []
    for name in said["files"]:
        assert Path(name).stat().st_size > 0
    assert (tmp_path / "out/decks/S10a.xml").is_file()
    assert "Not compared: mujoco" in (tmp_path / "out/bench.md").read_text(encoding="utf-8")


def test_a_run_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    # negative: whenever progress is told, the limit has passed
    hurried = replace(all_scenes()["S4stick"], limit=-1.0)
    monkeypatch.setattr(runner, "all_scenes", lambda: {"S4stick": hurried})
    done = call(
        *("S4stick", "--no-peers", "--tol", "1e-4", "--integrator", "DOPRI5"),
        *("--repeats", 1, "-o", tmp_path, "--json"),
    )
    assert done.exit_code == 0, done.stderr
    notes = {row["note"].split(" at time")[0] for row in json.loads(done.stdout)["rows"]}
    assert notes == {
        "failed: given up after -1 s",
        "left out: DOPRI5 was given up at this tolerance",
    }


def test_missing_peers_are_named_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "available", lambda: [])
    done = call("S10a", "--tol", "1e-3", "--repeats", 1, "-o", tmp_path)
    assert done.exit_code == 0
    (line,) = [line for line in done.stderr.splitlines() if "not installed" in line]
    assert "mujoco, exudyn, pybullet, drake, ode" in line
    assert line.endswith("mbsim-contact[bench] has them, but for ode: a library and a C compiler")


def test_a_machine_without_peers(tmp_path, monkeypatch):
    for name in peers.PACKAGES.values():
        monkeypatch.setitem(sys.modules, name, None)  # import raises, and no spec is found
    monkeypatch.setenv("PATH", "")  # no C compiler: nothing builds the driver of ODE
    assert peers.available() == []
    done = call("S10a", "--tol", "1e-3", "--integrator", "DOPRI5", "--repeats", 1, "-o", tmp_path)
    assert done.exit_code == 0, done.stderr
    assert "Not compared: mujoco, exudyn, pybullet, drake, ode." in done.stdout
    assert "[1/1] S10a mbsim DOPRI5 tol=0.001: " in done.stderr


def test_a_peer_that_cannot_be_imported_has_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "available", lambda: ["pybullet"])
    monkeypatch.setattr(pybullet, "_engine", pybullet._engine.__wrapped__)
    monkeypatch.setattr(pybullet, "version", lambda: pybullet._engine().__version__)
    monkeypatch.setitem(sys.modules, "pybullet", None)
    done = call("S10a", "--tol", "1e-3", "--repeats", 1, "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.stderr
    notes = [row["note"] for row in json.loads(done.stdout)["rows"] if row["engine"] != OURS]
    assert notes
    assert all(note.startswith("failed: import of pybullet halted") for note in notes)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("S99",), 2, "scene S99: not known; there are S1, "),
        (("S1", "--tol", "x"), 2, "numbers separated by commas"),
        (("S1", "--tol", "-1"), 2, "tol=-1 is not allowed"),
        (("S1", "--integrator", "EULER"), 2, "integrator=EULER is not known"),
    ],
)
def test_wrong_usage(tmp_path, arguments, code, said):
    done = call(*arguments, "--no-peers", "-o", tmp_path)
    assert done.exit_code == code
    assert said in done.stderr


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    done = call("S1", "--no-peers", "-o", tmp_path / "file")
    assert done.exit_code == 5
    assert "cannot be written" in done.stderr
