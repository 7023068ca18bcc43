"""Every function of the language against an independent evaluation, at 1000 random points each.

The text goes the way of a deck's: parsed, built, evaluated by compiled code and by plain Python.
Derivatives by time are compared with high-order differences of the independent evaluation.
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from helpers import free_bodies as free
from helpers.language_truth import CASES, MOST_ARGS
from helpers.measure_truth import Motion, component, fixed, measure, opposite
from helpers.minimal_deck import deck, read
from mbsim.arrays.codes import SHOWN
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import pack, view
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.contact.forces import FORCE
from mbsim.dynamics.expressions.jets import jet, value
from mbsim.dynamics.pipeline.hook_table import put
from mbsim.expressions.functions import FUNCTIONS, Kind
from mbsim.expressions.parse import parse
from mbsim.forces.catalog import FORCES as KINDS
from mbsim.model import elements as el
from mbsim.model.curves import (
    CurveOnCurve,
    ParamCurve,
    ParamSurface,
    PointOnCurve,
    PointOnSurface,
)

POINTS = 1000
#: Of these, plain Python takes the first where it would take long.
FEW = 100
#: Widths of differences of order 8 [T]; two that follow each other must agree.
WIDTHS = (1 / 64, 1 / 128, 1 / 256)
#: Of the points, as many may lie so near to a kink or a jump that differences do not converge.
UNSURE = 100


def scene_of(texts, *bodies, **elements):
    """Return a system whose last programs are these texts, and the number of the first."""
    exprs = tuple(parse(text) for text in texts)
    system = build(
        free.model(*bodies, requests=[el.Request(1, "EXPRESSION", exprs=exprs)], **elements)
    )
    put(system.scene, Hook.VALUE)
    return system, len(system.scene.programs.start) - 1 - len(texts)


def both_ways(run, scene, *given, few=POINTS):
    """Return what plain Python (of a few points) and compiled code write to the last array."""
    plain, compiled = given[-1][:few].copy(), given[-1].copy()
    cut = [arg[:few] if isinstance(arg, np.ndarray) else arg for arg in given[:-1]]
    with np.errstate(all="raise"):
        run(scene, *cut, plain)
    table = pack(scene)
    _compiled(run)(int(table.ctypes.data), *given[:-1], compiled)
    assert len(table)  # is not freed before
    return plain, compiled


@functools.cache
def _compiled(run):
    return jit.function(_COMPILED[run])


@jitable
def values_of_states(scene, first, states, program, out):
    """Evaluate a program where numbers (n, args) are the states from place `first` of y on."""
    y = np.zeros(scene.rows.y.shape[1])
    for n in range(len(states)):
        y[first : first + states.shape[1]] = states[n]
        out[n] = value(scene, 0.0, y, program)


@jitable
def jets_of_states(scene, times, ys, program, out):
    """Evaluate jets (n, 3) of a program at states of bodies."""
    for n in range(len(ys)):
        place_bodies(scene, ys[n])
        out[n, 0], out[n, 1], out[n, 2] = jet(scene, times[n], ys[n], program)


@jitable
def measures_of_states(scene, ys, accelerations, turned, first, out):
    """Evaluate programs (n, programs) from `first` on at states of bodies."""
    for n in range(len(ys)):
        place_bodies(scene, ys[n])
        scene.rows.accel[0] = accelerations[n]
        scene.state.angle[:] = turned[n]
        for k in range(out.shape[1]):
            out[n, k] = value(scene, 0.0, ys[n], first + k)


@jitable
def forces_of_states(scene, ys, applied, reactions, first, out):
    """Evaluate programs (n, programs) from `first` on where forces are given."""
    for n in range(len(ys)):
        place_bodies(scene, ys[n])
        scene.work.applied[:, :6] = applied[n]
        scene.work.reaction[: reactions.shape[1]] = reactions[n]
        for k in range(out.shape[1]):
            out[n, k] = value(scene, 0.0, ys[n], first + k)


def _values_of_states(context, first, states, program, out):
    values_of_states(view(context, Scene), first, states, program, out)


def _jets_of_states(context, times, ys, program, out):
    jets_of_states(view(context, Scene), times, ys, program, out)


def _measures_of_states(context, ys, accelerations, turned, first, out):
    measures_of_states(view(context, Scene), ys, accelerations, turned, first, out)


def _forces_of_states(context, ys, applied, reactions, first, out):
    forces_of_states(view(context, Scene), ys, applied, reactions, first, out)


_COMPILED = {
    values_of_states: _values_of_states,
    jets_of_states: _jets_of_states,
    measures_of_states: _measures_of_states,
    forces_of_states: _forces_of_states,
}


def assert_near(found, wanted, tol=1e-12):
    """Fail where numbers differ by more than tol times max(1, size); take the first of `wanted`."""
    wanted = wanted[: len(found)]
    error = np.abs(found - wanted) / np.maximum(1.0, np.abs(wanted))
    assert np.isfinite(error).all()
    assert error.max() <= tol, (error.max(), int(error.argmax()))


def differences(f, h):
    """Return first and second derivative at 0 by central differences of order 8."""
    first = [(1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280)]
    second = [(1, 8 / 5), (2, -1 / 5), (3, 8 / 315), (4, -1 / 560)]
    at = {k: f(k * h) for k in range(-4, 5)}
    d1 = sum(c * (at[k] - at[-k]) for k, c in first) / h
    d2 = sum(c * (at[k] + at[-k]) for k, c in second)
    return d1, (d2 - 205 / 72 * at[0]) / h**2


def slopes(f):
    """Return both derivatives (2, n) of f(t) at 0, and where the differences converge."""
    tried = np.array([differences(f, h) for h in WIDTHS])
    apart = np.abs(np.diff(tried, axis=0)) / np.maximum(1.0, np.abs(tried[1:]))
    worst = apart.max(axis=1)  # of both orders
    best = worst.argmin(axis=0)
    points = np.arange(len(best))
    return tried[1 + best, :, points].T, worst[best, points] < 5e-9


def assert_derivatives(found, f):
    """Compare jets (n, 3) with differences of f(t), wherever these converge."""
    wanted, sure = slopes(f)
    assert np.count_nonzero(~sure) <= UNSURE
    sure = sure[: len(found)]
    for order in (1, 2):
        assert_near(found[sure, order], wanted[order - 1, : len(found)][sure], 1e-8)


# --- functions of numbers ---------------------------------------------------------------------

BODIES = (free.body(2), free.body(3), free.body(4))
COORDINATES = [f"D{axis}({marker})" for marker in (20, 30, 40) for axis in "XYZ"]


@functools.cache
def elementary_scene():
    """Return a system with the cases of states, and the number of the first program."""
    texts = [case.text.format(*(f"DIF({k + 1})" for k in range(MOST_ARGS))) for case in CASES]
    states = [el.Differential(k + 1, parse("0")) for k in range(MOST_ARGS)]
    return scene_of(texts, *BODIES, differentials=states)


@functools.cache
def jet_scene():
    """Return a system with the cases of what moves: every argument is x + TIME**2/8."""
    args = [f"({place} + TIME**2/8)" for place in COORDINATES]
    system, first = scene_of([case.text.format(*args) for case in CASES], *BODIES)
    put(system.scene, Hook.JET)
    return system, first


def arguments(k):
    """Return arguments (args, n) of a case."""
    return CASES[k].draw(np.random.default_rng(100 + k), POINTS)


def count_of(case):
    """Return how many arguments a case has."""
    return max(j for j in range(MOST_ARGS) if f"{{{j}}}" in case.text) + 1


NAMES = [case.text for case in CASES]


@pytest.mark.parametrize("k", range(len(CASES)), ids=NAMES)
def test_functions_of_numbers(k):
    system, first = elementary_scene()
    args, n = arguments(k), count_of(CASES[k])
    place = int(system.scene.states.offset[0])
    states = np.ascontiguousarray(args.T)
    found = both_ways(values_of_states, system.scene, place, states, first + k, np.zeros(POINTS))
    for way in found:
        assert_near(way, CASES[k].truth(*args[:n]))


@pytest.mark.parametrize("k", range(len(CASES)), ids=NAMES)
def test_derivatives_of_functions_of_numbers(k):
    system, first = jet_scene()
    case, rng = CASES[k], np.random.default_rng(1000 + k)
    args, n = arguments(k), count_of(case)
    times = rng.uniform(0, 1, POINTS)
    # rates are such that no argument comes far: functions of domains stay in them
    rates = rng.uniform(-0.8, 0.8, (len(args), POINTS))
    ys = np.tile(system.y0, (POINTS, 1))
    for j in range(len(args)):
        at = 13 * (j // 3) + j % 3
        ys[:, at], ys[:, at + 7] = args[j] - times**2 / 8, rates[j]
    out = np.zeros((POINTS, 3))
    found = both_ways(jets_of_states, system.scene, times, ys, first + k, out, few=FEW)

    def moved(t):
        return case.truth(*(args + rates * t + (2 * times * t + t * t) / 8)[:n])

    for way in found:
        assert_near(way[:, 0], moved(0.0))
        assert_derivatives(way, moved)


# --- what markers measure ---------------------------------------------------------------------


def matrix(seed):
    """Return some rotation."""
    rng = np.random.default_rng(seed)
    return free.rotation(rng.normal(size=3), rng.uniform(0.3, 2.8))


#: Body row (2 is ground), place and axes of each marker; 0 is the global frame.
MARKERS = {
    11: (2, (0.4, -0.7, 0.2), matrix(11)),
    21: (0, (0.3, 0.1, -0.5), matrix(21)),
    22: (0, (-0.6, 0.2, 0.9), matrix(22)),
    31: (1, (0.8, -0.2, 0.1), matrix(31)),
    32: (1, (-0.1, 0.5, 0.4), matrix(32)),
}
MARKER_ELEMENTS = [
    el.Marker(id, body_id=(2, 3, 1)[row], pos=pos, R=R) for id, (row, pos, R) in MARKERS.items()
]
CALLS = ((21, 31, 11, 22), (32, 21, 22, 11), (22, 11, 31, 21), (31, 22, 32, 32))
_MARKED = (Kind.DISPLACEMENT, Kind.VELOCITY, Kind.ACCELERATION)
MEASURES = [name for name, function in FUNCTIONS.items() if function.kind in _MARKED]


def calls_of(name):
    """Return calls of a measure: (first number or none, ids of markers)."""
    function = FUNCTIONS[name]
    least, most = function.least, len(function.args)
    if name == "ORIENT":
        return [(n, ids[:m]) for n in (1, 2, 3, 4) for m in (1, 2) for ids in CALLS]
    return [(None, ids[:m]) for m in range(least, most + 1) for ids in CALLS]


def text_of(name, number, ids):
    """Return a call as text."""
    given = [*(("27", number) if number else ()), *ids]
    return f"{name}({', '.join(map(str, given))})"


LISTED = [(name, number, ids) for name in MEASURES for number, ids in calls_of(name)]


def states_of(system, seed):
    """Return random states (n, y) of two bodies and the motions of the bodies."""
    rng = np.random.default_rng(seed)
    ys, motions = np.tile(system.y0, (POINTS, 1)), []
    for row in range(2):
        p, v, w, a, alpha = rng.normal(size=(5, POINTS, 3))
        q = rng.normal(size=(POINTS, 4))
        q /= np.linalg.norm(q, axis=1)[:, None]
        motion = Motion(p, q, v, w, a, alpha)
        R = motion.frame(np.zeros(3), np.eye(3)).R
        ys[:, 13 * row : 13 * row + 13] = np.hstack(
            [p, q, v, np.einsum("nji,nj->ni", R, w)]  # w along the body's axes
        )
        motions.append(motion)
    return ys, motions


def frames_of(motions, after=0.0):
    """Return the frames of all markers."""
    made = {0: fixed(POINTS)}
    for id, (row, pos, R) in MARKERS.items():
        made[id] = fixed(POINTS, pos, R) if row == 2 else motions[row].frame(pos, R, after)
    return made


@functools.cache
def measured():
    """Return plain and compiled values (n, calls), motions, and followed angles as committed."""
    system, first = scene_of(
        [text_of(*call) for call in LISTED], *BODIES[:2], markers=MARKER_ELEMENTS
    )
    ys, motions = states_of(system, 5)
    rng = np.random.default_rng(6)
    accelerations = np.hstack([np.hstack([m.a, m.alpha]) for m in motions])
    turned = rng.uniform(-20, 20, (POINTS, len(system.scene.angles.i)))
    given = (ys, accelerations, turned, first, np.zeros((POINTS, len(LISTED))))
    found = both_ways(measures_of_states, system.scene, *given, few=FEW)
    codes = system.scene.programs.code[system.scene.programs.start[first : first + len(LISTED)]]
    near = [
        turned[:, code[1]] if name in ("AX", "AY", "AZ") else 0.0
        for (name, _, _), code in zip(LISTED, codes, strict=True)
    ]
    return found, motions, near


def truth_of(call, motions, near, after=0.0):
    """Return the independent value of a call."""
    name, number, ids = call
    frames = frames_of(motions, after)
    args = [frames[id] for id in ids]
    if name not in ("INCANG",) and len(args) == 1:
        args.append(frames[0])
    return measure(name, *((number,) if number else ()), *args, near=near)


@pytest.mark.parametrize("name", MEASURES)
def test_measures_of_markers(name):
    found, motions, near = measured()
    for k, call in enumerate(LISTED):
        if call[0] == name:
            for way in found:
                assert_near(way[:, k], truth_of(call, motions, near[k]))


DISPLACED = [name for name in MEASURES if FUNCTIONS[name].kind is Kind.DISPLACEMENT]


@functools.cache
def displaced_scene():
    """Return the system of the calls of displacements."""
    calls = [call for call in LISTED if call[0] in DISPLACED]
    system, first = scene_of(
        [text_of(*call) for call in calls], *BODIES[:2], markers=MARKER_ELEMENTS
    )
    put(system.scene, Hook.JET)
    return system, first, calls


@pytest.mark.parametrize("name", DISPLACED)
def test_derivatives_of_displacements(name):
    system, first, calls = displaced_scene()
    ys, motions = states_of(system, 8)
    system.scene.state.angle[:] = 0.0
    for k, call in enumerate(calls):
        if call[0] == name and call[2][0] in (21, 31):
            out = np.zeros((POINTS, 3))
            given = (np.zeros(POINTS), ys, first + k, out)
            found = both_ways(jets_of_states, system.scene, *given, few=FEW)
            for way in found:
                assert_near(way[:, 0], truth_of(call, motions, 0.0))
                assert_derivatives(way, lambda t, call=call: truth_of(call, motions, 0.0, t))


# --- forces -----------------------------------------------------------------------------------


def needed(kind):
    """Return what must be given of a kind of forces between markers."""
    given = [each for each in kind.parameters if each.default is None and not each.optional]
    return {each.name: each.words[-1] if each.words else 1.0 for each in given}


#: One of every kind of forces between markers that has a function.
MARKER_FORCES = [
    free.force(kind.name, 40 + k, 21, 31, **needed(kind))
    for k, kind in enumerate(KINDS[name] for name in KINDS)
    if kind.functions and not kind.table
]
# of one marker, its own row being the only one
MARKER_FORCES.append(
    el.MarkerForce(
        39, "NFORCE", "", 21, 31, (("place", 0), ("constants", (1.0, *np.ones(1 + 12 + 108))))
    )
)
PUSHES = {
    **{(force.kind, force.id): (21, 31) for force in MARKER_FORCES},
    ("SFORCE", 1): (21, 31),
    ("SFORCE", 3): (21, 11),  # alone: nothing acts on J
    ("VECTORFORCE", 5): (21, 32),  # J floats: it is where I is
    ("JOINT", 6): (32, 22),
    ("JPRIM", 7): (22, 31),
    ("MOTION", 8): (31, 22),
    ("PTCV", 9): (22, 32),
    ("CVCV", 10): (32, 21),
    ("PTSF", 11): (21, 32),
}
BOWL_FILE = str(Path(__file__).parents[1] / "corpus/bowl.py")
BOWL = el.Subroutine((0.5,), "bowl", script_name=BOWL_FILE)
ALONE, FLOATING = {("SFORCE", 3)}, {("VECTORFORCE", 5)}
FORCES = {
    "scalar_forces": [
        el.ScalarForce(1, "TRANSLATIONAL", parse("2"), "", 21, 31),
        el.ScalarForce(3, "TRANSLATIONAL", parse("5"), "", 21, 11, action_only=True),
    ],
    "marker_forces": MARKER_FORCES,
    "vector_forces": [
        el.VectorForce(5, exprs=(parse("1"),) * 6, i_marker_id=21, j_floating_marker_id=32)
    ],
    "joints": [el.Joint(6, "SPHERICAL", "", 32, 22)],
    "primitives": [el.Joint(7, "INPLANE", "", 22, 31, is_primitive=True)],
    "motions": [el.Motion(8, "", None, 31, 22, "X", expr=parse("TIME"))],
    "points_on_curves": [PointOnCurve(9, 22, 32, 1)],
    "curves_on_curves": [CurveOnCurve(10, 32, 21, 2, 2)],
    "points_on_surfaces": [PointOnSurface(11, 21, 32, 3)],
    "surfaces": [
        ParamSurface(
            3, (0.0, 1.0), (0.0, 1.0), el.Subroutine((0.5,), "bowl", script_name=BOWL_FILE)
        )
    ],
    "curves": [
        ParamCurve(1, ((0.0, 0.0, 0.0), (1.0, 0.2, 0.0), (2.0, 0.0, 1.0), (3.0, 0.0, 0.0))),
        ParamCurve(2, ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 4.0, 0.0), (3.0, 9.0, 0.0))),
    ],
}
NET_NAMES = ("FM", "FX", "FY", "FZ", "TM", "TX", "TY", "TZ")
FORCE_NAMES = [name for name, function in FUNCTIONS.items() if function.kind is Kind.FORCE]
CONTACT_NAMES = ("CONTACT", "CONTACT(3)")
ELEMENT_NAMES = [name for name in FORCE_NAMES if name not in (*NET_NAMES, *CONTACT_NAMES)]
PAIRS = [(21, 31, 11), (31, 21, 22), (32, 21), (21, 32, 32), (22, 32, 11), (22, 31, 31), (21, 22)]


def force_calls():
    """Return all calls that are compared: of net forces by markers, of elements by arguments."""
    calls = [(name, ids) for name in NET_NAMES for ids in (*PAIRS, (21,))]
    for name in ELEMENT_NAMES:
        statement = FUNCTIONS[name].args[0]
        for key in (key for kind, key in PUSHES if kind == statement):
            for jflag in (0, 1):
                calls += [(name, (key, jflag, comp, 31)) for comp in range(1, 9)]
                calls.append((name, (key, jflag, 2)))
    return calls


@functools.cache
def forces():
    """Return values of all calls both ways, frames, and force and torque of each element on I."""
    texts = [f"{name}({','.join(map(str, args))})" for name, args in force_calls()]
    system, first = scene_of(texts, *BODIES[:2], markers=MARKER_ELEMENTS, **FORCES)
    ys, motions = states_of(system, 9)
    rng = np.random.default_rng(10)
    applied = rng.normal(size=(POINTS, len(system.applied), 6))
    reactions = rng.normal(size=(POINTS, 6 * len(system.connections)))
    out = np.zeros((POINTS, len(texts)))
    found = both_ways(forces_of_states, system.scene, ys, applied, reactions, first, out, few=FEW)
    wrenches = {key: applied[:, k] for k, key in enumerate(system.applied)}
    wrenches |= {key: reactions[:, 6 * k : 6 * k + 6] for k, key in enumerate(system.connections)}
    assert set(wrenches) == set(PUSHES)
    return found, frames_of(motions), wrenches


def on_side(frames, wrenches, key, jflag):
    """Return force and torque of an element on I or on J."""
    force, torque = wrenches[key][:, :3], wrenches[key][:, 3:]
    if jflag == 0:
        return force, torque
    if key in ALONE:
        return np.zeros_like(force), np.zeros_like(torque)
    i, j = (frames[id] for id in PUSHES[key])
    return opposite(i, i if key in FLOATING else j, force, torque)


def net_truth(name, ids, frames, wrenches):
    """Return FM, FX, ... of i and j; of i alone what acts on it and on nothing else."""
    total = np.zeros((2, POINTS, 3))
    for key, (i, j) in PUSHES.items():
        if len(ids) == 1 and key in ALONE and i == ids[0]:
            total += on_side(frames, wrenches, key, 0)
        if len(ids) > 1 and key not in ALONE and {i, j} == set(ids[:2]):
            total += on_side(frames, wrenches, key, 0 if i == ids[0] else 1)
    return component(*total, frames[ids[2] if len(ids) > 2 else 0], 1 + NET_NAMES.index(name))


@pytest.mark.parametrize("name", [*NET_NAMES, *ELEMENT_NAMES])
def test_forces(name):
    found, frames, wrenches = forces()
    for k, (called, args) in enumerate(force_calls()):
        if called != name:
            continue
        if name in NET_NAMES:
            wanted = net_truth(name, args, frames, wrenches)
        else:
            sides = on_side(frames, wrenches, (FUNCTIONS[name].args[0], args[0]), args[1])
            wanted = component(*sides, frames[args[3] if len(args) > 3 else 0], args[2])
        for way in found:
            assert_near(way[:, k], wanted)


@jitable
def contacts_of_states(scene, ys, hits, forces, points, first, out):
    """Evaluate programs (n, programs) from `first` on where incidents are given."""
    for n in range(len(ys)):
        place_bodies(scene, ys[n])
        scene.work.hit[:] = hits[n]
        scene.work.slot[:, FORCE : FORCE + 6] = forces[n]
        scene.work.points[:, 1:4] = points[n]
        for k in range(out.shape[1]):
            out[n, k] = value(scene, 0.0, ys[n], first + k)


def _contacts_of_states(context, ys, hits, forces, points, first, out):
    contacts_of_states(view(context, Scene), ys, hits, forces, points, first, out)


_COMPILED[contacts_of_states] = _contacts_of_states
BOX = (
    '"200" type="Sphere" center_marker_id="20" radius="0.108"',
    '"200" type="BoxDefinedFromCenter" center_marker_id="20" length_x="1" length_y="2"'
    ' length_z="3"',
)


def test_forces_of_contacts(tmp_path):
    calls = [(jflag, comp) for jflag in (0, 1) for comp in range(1, 9)]
    exprs = [f'expr{k % 8 + 1}="CONTACT(301,{j},{comp},20)"' for k, (j, comp) in enumerate(calls)]
    requests = [
        f'<Post_Request id="{n + 1}" type="EXPRESSION" {" ".join(exprs[8 * n : 8 * n + 8])}/>'
        for n in (0, 1)
    ]
    model = read(tmp_path, deck(BOX, ("</Model>", "\n".join([*requests, "</Model>"]))))
    system = build(model)
    scene = system.scene
    put(scene, Hook.VALUE)
    rng = np.random.default_rng(12)
    slots = len(scene.work.hit) - 1
    assert slots > 3
    ys, motions = np.tile(system.y0, (POINTS, 1)), rng.normal(size=(POINTS, 13))
    motions[:, 3:7] /= np.linalg.norm(motions[:, 3:7], axis=1)[:, None]
    ys[:, :13] = motions
    number = rng.integers(0, slots + 1, POINTS)
    hits = np.hstack(
        [rng.permuted(np.tile(np.arange(slots), (POINTS, 1)), axis=1), number[:, None]]
    )
    wrenches, points = rng.normal(size=(POINTS, slots, 6)), rng.normal(size=(POINTS, slots, 3))
    first = len(scene.programs.start) - 1 - len(calls)
    out = np.zeros((POINTS, len(calls)))
    found = both_ways(contacts_of_states, scene, ys, hits, wrenches, points, first, out, few=FEW)

    touching = np.zeros((POINTS, slots, 1))
    for n in range(POINTS):
        touching[n, hits[n, : number[n]]] = 1.0
    force = (touching * wrenches[:, :, :3]).sum(axis=1)
    about_origin = (touching * (np.cross(points, wrenches[:, :, :3]) + wrenches[:, :, 3:])).sum(
        axis=1
    )
    zero = np.zeros((POINTS, 3))
    box = Motion(motions[:, :3], motions[:, 3:7], zero, zero, zero, zero).frame(
        (0, 0, 0), np.eye(3)
    )
    on = ((force, about_origin - np.cross(box.p, force)), (-force, -about_origin))
    for k, (jflag, comp) in enumerate(calls):
        for way in found:
            assert_near(way[:, k], component(*on[jflag], box, comp))


# --- tables, variables, states ----------------------------------------------------------------

_KNOTS = np.cumsum(np.random.default_rng(21).uniform(0.4, 1.0, 12)) - 4.0
_CURVES = np.random.default_rng(22).normal(size=(3, 12))
LEVELS = (-1.0, 0.5, 1.2)
SPLINES = [
    el.Spline(1, tuple(_KNOTS), (tuple(_CURVES[0]),)),
    el.Spline(2, tuple(_KNOTS), tuple(map(tuple, _CURVES)), LEVELS),
    el.Spline(3, tuple(_KNOTS), (tuple(_CURVES[1]),), linear_extrapolate=True),
]


def curve(method, y, linear, order, x):
    """Return a curve or a derivative by x: SciPy's between the points, polynomials outside."""
    if method == "LINSPL":
        inside = np.interp(x, _KNOTS, y) if order == 0 else np.zeros_like(x)
        if order == 1:
            inside = (np.diff(y) / np.diff(_KNOTS))[np.clip(np.searchsorted(_KNOTS, x) - 1, 0, 10)]
    elif method == "AKISPL":
        inside = Akima1DInterpolator(_KNOTS, y)(np.clip(x, _KNOTS[0], _KNOTS[-1]), nu=order)
    else:
        inside = CubicSpline(_KNOTS, y, bc_type="natural")(x, nu=order)
    points = 2 if linear or method == "LINSPL" else 3
    ends = [
        np.polynomial.Polynomial.fit(_KNOTS[at], y[at], points - 1)
        for at in (slice(points), slice(-points, None))
    ]
    low, high = (end.deriv(order)(x) if order else end(x) for end in ends)
    return np.select([x < _KNOTS[0], x > _KNOTS[-1]], [low, high], inside)


def spline_truth(method, spline, order, x, z):
    """Return a spline: linear in z between its curves and beyond them."""
    if not spline.z:
        return curve(
            method, _CURVES[0 if spline.id == 1 else 1], spline.linear_extrapolate, order, x
        )
    levels = np.array(LEVELS)
    values = np.array([curve(method, y, False, order, x) for y in _CURVES])
    low = np.clip(np.searchsorted(levels, z, side="right") - 1, 0, 1)
    at = np.arange(len(x))
    share = (z - levels[low]) / (levels[low + 1] - levels[low])
    return (1 - share) * values[low, at] + share * values[low + 1, at]


TABLES = [name for name, function in FUNCTIONS.items() if function.kind is Kind.TABLE]
SPLINE_NAMES = [name for name in TABLES if name != "ARYVAL"]


@pytest.mark.parametrize("name", SPLINE_NAMES)
def test_splines(name):
    calls = [(spline, order) for spline in SPLINES for order in (0, 1, 2)]
    states = [el.Differential(k + 1, parse("0")) for k in range(2)]
    texts = [f"{name}(DIF(1), DIF(2), {spline.id}, {order})" for spline, order in calls]
    system, first = scene_of(texts, *BODIES, differentials=states, splines=SPLINES)
    rng = np.random.default_rng(23)
    args = np.column_stack([rng.uniform(-5, 6, POINTS), rng.uniform(-2, 2, POINTS)])
    assert args[:, 0].min() < _KNOTS[0] < _KNOTS[-1] < args[:, 0].max()
    place = int(system.scene.states.offset[0])
    for k, (spline, order) in enumerate(calls):
        found = both_ways(values_of_states, system.scene, place, args, first + k, np.zeros(POINTS))
        for way in found:
            assert_near(way, spline_truth(name, spline, order, *args.T))


@pytest.mark.parametrize("name", SPLINE_NAMES)
def test_derivatives_of_splines(name):
    texts = [f"{name}(DX(20) + TIME**2/8, DY(20), {spline.id})" for spline in SPLINES]
    system, first = scene_of(texts, *BODIES, splines=SPLINES)
    put(system.scene, Hook.JET)
    rng = np.random.default_rng(24)
    ys, times = np.tile(system.y0, (POINTS, 1)), rng.uniform(0, 1, POINTS)
    ys[:, 0], ys[:, 1] = rng.uniform(-5, 6, POINTS), rng.uniform(-2, 2, POINTS)
    ys[:, 7:9] = rng.uniform(-0.8, 0.8, (POINTS, 2))
    for k, spline in enumerate(SPLINES):

        def moved(t, spline=spline):
            x = ys[:, 0] + t * ys[:, 7] + (times + t) ** 2 / 8
            return spline_truth(name, spline, 0, x, ys[:, 1] + t * ys[:, 8])

        out = np.zeros((POINTS, 3))
        found = both_ways(jets_of_states, system.scene, times, ys, first + k, out, few=FEW)
        for way in found:
            assert_derivatives(way, moved)


NUMBERS = tuple(np.random.default_rng(31).normal(size=POINTS))
#: Of functions of what the model keeps: the call, and its truth of two numbers that are drawn.
KEPT = {
    "DIF": ("DIF(2)", lambda a, b: b),
    "DIF1": ("DIF1(2)", lambda a, b: a * b + 1),
    "VARVAL": ("VARVAL(7)", lambda a, b: np.sin(a + b) - 2 * (a + b)),
    "SENVAL": ("SENVAL(5)", lambda a, b: 0 * a + 0.625),
}


@pytest.mark.parametrize("name", KEPT)
def test_what_the_model_keeps(name):
    states = [el.Differential(1, parse("0")), el.Differential(2, parse("DIF(1)*DIF(2) + 1"))]
    variables = [
        el.Variable(6, parse("DIF(1) + DIF(2)")),
        el.Variable(7, parse("SIN(VARVAL(6)) - 2*VARVAL(6)")),
    ]
    sensors = [el.Sensor(4, parse("TIME")), el.Sensor(5, parse("TIME"), evaluate=parse("TIME"))]
    text, truth = KEPT[name]
    system, first = scene_of(
        [text], *BODIES, differentials=states, variables=variables, sensors=sensors
    )
    system.scene.state.sensed[:, SHOWN] = 0.125, 0.625
    args = np.random.default_rng(32).normal(size=(POINTS, 2))
    place = int(system.scene.states.offset[0])
    for way in both_ways(values_of_states, system.scene, place, args, first, np.zeros(POINTS)):
        assert_near(way, truth(*args.T))


def test_arrays_of_numbers():
    texts = [f"ARYVAL(4, {k + 1})" for k in range(POINTS)]
    arrays = [el.ArrayOfNumbers(3, (1.0,)), el.ArrayOfNumbers(4, NUMBERS)]
    system, first = scene_of(texts, *BODIES, arrays=arrays)
    found = [value(system.scene, 0.0, system.y0, first + k) for k in range(POINTS)]
    assert found == list(NUMBERS)


def test_every_function_has_a_truth():
    called = {name for case in CASES for name in case.functions}
    known = {*called, *MEASURES, *NET_NAMES, *ELEMENT_NAMES, *CONTACT_NAMES, *TABLES, *KEPT}
    assert known == set(FUNCTIONS)
    assert {*SPLINE_NAMES, "ARYVAL"} == {"AKISPL", "CUBSPL", "LINSPL", "ARYVAL"}
    assert {statement for statement, _ in PUSHES} == {
        FUNCTIONS[name].args[0] for name in ELEMENT_NAMES
    }
