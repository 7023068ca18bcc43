"""Run a case and say how it ended, from its rows and its deck alone."""

from __future__ import annotations

import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from lxml import etree

from mbsim.bench.stress.case import Case, Motion
from mbsim.errors import MbsimError, ModelError

if TYPE_CHECKING:
    from mbsim.results.reading import Results

#: How a case may end: as it should; with a warning; with a reason why it went no farther; refused
#: by name because the method does not take such decks.
RIGHT, TOLD, ENDED, REFUSED = "right", "told", "ended", "refused"
#: How it may not: with a wrong number and no word; with a number that is none; not at all; with a
#: message for programmers.
SILENT, NAN, HANG, TRACEBACK = "silent", "nan", "hang", "traceback"
FAULTS = (SILENT, NAN, HANG, TRACEBACK)
#: What a step may add to the energy, over tol and the root of their number; and never more than
#: a part of the energy that moves.
OF_TOL, OF_ENERGY, ROUNDING = 100.0, 0.02, 1e-9
_AXES = ("xx", "yy", "zz")


class Verdict(NamedTuple):
    """How a case ended.

    Attributes
    ----------
    reason
        What was measured and what was allowed, or what the run said.
    worst
        The largest measure over what was allowed; 0 where nothing was measured.
    seconds
        CPU time of the whole run.
    """

    family: str
    deck: str
    integrator: str
    tol: float
    ended: str
    reason: str
    worst: float
    steps: int
    seconds: float


class _TooLong(Exception):
    """A run took longer than it may."""


def verdict(case: Case, ended: str, reason: str = "", **facts: float) -> Verdict:
    """Return the verdict of a case."""
    return Verdict(
        case.deck.family,
        case.deck.name,
        case.integrator,
        case.tol,
        ended,
        reason,
        float(facts.get("worst", 0.0)),
        int(facts.get("steps", 0)),
        float(facts.get("seconds", 0.0)),
    )


def judge(case: Case, folder: Path, limit: float) -> Verdict:
    """Run a case with its files in `folder`, for `limit` seconds of CPU time at most."""
    from mbsim.reader.xml import read_model
    from mbsim.run.simulation import simulate

    path = folder / "deck.xml"
    path.write_text(case.deck.text, encoding="utf-8")
    began, told = time.process_time(), []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # of our own NumPy code
            results = simulate(
                read_model(path),
                integrator=case.integrator,
                tol=case.tol,
                output=folder,
                allow_overlap=True,
                progress=_stop_after(began + limit),
                notify=lambda note: told.append(note) if "warning" in note else None,
            )
    except _TooLong:
        return verdict(case, HANG, f"longer than {limit:g} s", seconds=limit)
    except ModelError as error:
        return verdict(case, REFUSED, _line(error), seconds=time.process_time() - began)
    except MbsimError as error:
        return _gave_up(case, folder, _line(error), time.process_time() - began)
    except Exception:  # none of ours, whatever it is: a fault of the program
        text = traceback.format_exc(limit=-2).replace("\n", " ")
        return verdict(case, TRACEBACK, text, seconds=time.process_time() - began)
    with results:
        return _judged(case, results, told, time.process_time() - began)


def _stop_after(until: float) -> Callable[[float, float, float], None]:
    def progress(t: float, step: float, end_time: float) -> None:
        if time.process_time() > until:
            raise _TooLong

    return progress


def _line(error: MbsimError) -> str:
    return str(error).splitlines()[0]


def _gave_up(case: Case, folder: Path, said: str, seconds: float) -> Verdict:
    """Return the verdict of a run that ended early: what it recorded must be there, and finite."""
    from mbsim.results.reading import open_results

    try:
        with open_results(folder / "deck.h5") as results:
            rows = results["time"]
            if not np.isfinite(results["bodies/2/position"]).all():
                return verdict(case, NAN, f"rows of {said}", seconds=seconds)
    except MbsimError as error:
        return verdict(case, TRACEBACK, f"no results of {said}: {error}", seconds=seconds)
    return verdict(case, ENDED, said, worst=0.0, steps=len(rows), seconds=seconds)


def _judged(case: Case, results: Results, told: list[str], seconds: float) -> Verdict:
    """Return the verdict of a run that finished."""
    motion = motion_of(case.deck.text, results)
    if not all(np.isfinite(rows).all() for rows in motion):
        return verdict(case, NAN, "rows", steps=motion.steps, seconds=seconds)
    measures = case.deck.check(motion, case.tol) if case.deck.check else {}
    moved = motion.size + case.deck.stored
    allowed = min(OF_ENERGY, OF_TOL * case.tol * np.sqrt(motion.steps) + ROUNDING) * moved
    # a place is right to tol times a length: the weight of what rests makes energy of it
    allowed += 10.0 * case.tol * motion.load * np.abs(motion.x).max()
    gained = float((motion.energy - motion.energy[0]).max()) - case.deck.stored
    measures["energy gained"] = (gained, allowed)
    worst, reason = 0.0, ""
    for name, (value, allowed) in measures.items():
        part = value / allowed if allowed > 0.0 else (0.0 if value <= 0.0 else np.inf)
        if part > worst:
            worst, reason = part, f"{name} {value:.2g} of {allowed:.2g} allowed"
    ended = RIGHT if worst <= 1.0 else SILENT
    if told:
        ended, reason = TOLD, "; ".join(filter(None, (told[0], reason)))
    return verdict(case, ended, reason, worst=worst, steps=motion.steps, seconds=seconds)


def motion_of(text: str, results: Results) -> Motion:
    """Return rows of a run, with energies from masses, inertias and gravity of its deck.

    cg markers stand along the global axes at the start, and the body's own axes with them.
    """
    root = etree.fromstring(text.encode())
    bodies = {
        int(entry.get("id", "")): entry
        for entry in root.iter("Body_Rigid")
        if entry.get("isground") is None
    }
    ids = sorted(bodies)
    x, v, w, q = (
        np.stack([results[f"bodies/{body}/{name}"] for body in ids], axis=1)
        for name in ("position", "velocity", "angular_velocity", "quaternion")
    )
    mass = np.array([float(bodies[body].get("mass", "")) for body in ids])
    inertia = np.array([[float(bodies[b].get(f"inertia_{n}", "")) for n in _AXES] for b in ids])
    pull = np.zeros(3)
    for entry in root.iter("Force_Gravity"):
        pull = np.array([float(entry.get(f"grav_{axis}", "0")) for axis in "xyz"])
    R = _rotations(q)
    own = np.einsum("nbji,nbj->nbi", R, w)
    kinetic = 0.5 * ((v**2).sum(axis=-1) @ mass + (inertia * own**2).sum(axis=(-2, -1)))
    steps = int(results.stats["steps"])
    load = float(mass.sum() * np.linalg.norm(pull))
    return Motion(results["time"], x, v, w, R, kinetic, -(x @ pull) @ mass, load, steps)


def _rotations(q: np.ndarray) -> np.ndarray:
    """Return rotation matrices of unit quaternions, w first."""
    a, b, c, d = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
