"""What is compiled ahead: a list of things to do, each of which compiles what it meets first."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mbsim.errors import MbsimError, ModelError
from mbsim.integrators.catalog import AUTO, IMPLICIT, METHODS

if TYPE_CHECKING:
    from mbsim.model.elements import Model

#: In an installed package the models lie within it, in a checkout where all decks are.
FOLDERS = (
    Path(__file__).parents[1] / "examples" / "models",
    Path(__file__).parents[2] / "models",
)
#: Models that between them have what most models have: free bodies, mechanisms of trees and of
#: loops, motions, expressions, forces of all kinds, contacts of most shapes, friction that sticks.
USUAL = (
    "bowling_ball.xml",
    "bouncing_sphere.xml",
    "chain_on_box.xml",
    "four_bar_stop.xml",
    "cam.xml",
    "cam_roller.xml",
    "geneva.xml",
    "mesh_on_plane.xml",
    "ellipsoid_on_box.xml",
    "stiction_incline.xml",
    "stiff/box_stack.xml",
    "stiff/bushing_chain.xml",
    "stiff/jammed_wedge.xml",
    "stiff/lugre.xml",
    "stiff/standing_cylinder.xml",
)
#: Models that a run must be given a --plugin for.
WITHOUT_SUBROUTINE = ("seed_contact.xml",)
#: Part of its simulated time that a model is run for.
PART = 1e-3


class Task(NamedTuple):
    """Something that compiles what it meets, and its name."""

    name: str
    do: Callable[[], object]


def models_folder() -> Path | None:
    """Return where the models are that come with mbsim, None where they are not."""
    return next((folder for folder in FOLDERS if folder.is_dir()), None)


def tasks(everything: bool, models: Sequence[str]) -> list[Task]:
    """Return what is to be done: for `models` alone, for what most models have, or for all."""
    if models:
        return [*_runs(models, tuple(METHODS) if everything else (AUTO, IMPLICIT))]
    folder = models_folder()
    if folder is None:
        raise ModelError("the models that come with mbsim are not there; name some")
    if not everything:
        return [*_laws(), *_runs([str(folder / name) for name in USUAL], (AUTO, IMPLICIT))]
    files = sorted([*folder.glob("*.xml"), *folder.glob("stiff/*.xml")])
    files = [file for file in files if file.name not in WITHOUT_SUBROUTINE]
    return [
        *_laws(),
        *_pairs(),
        *_runs(map(str, files), (AUTO, IMPLICIT)),
        *_texts((AUTO, IMPLICIT)),
        *_runs([str(folder / USUAL[0])], tuple(METHODS)),
        Task("signals after the fact", functools.partial(_again, folder / USUAL[0])),
        *_solvers(),
    ]


def _laws() -> Iterator[Task]:
    """Yield the laws that are built in."""
    from mbsim.laws import abi
    from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS

    for name in NORMAL_LAWS:
        yield Task(name, functools.partial(abi.normal_address, NORMAL_LAWS[name]))
    for name in FRICTION_LAWS:
        for law in (FRICTION_LAWS[name], FRICTION_LAWS[name].rigid):
            if law is not None:
                yield Task(name, functools.partial(abi.friction_address, law))


def _pairs() -> Iterator[Task]:
    """Yield the pairs of shapes that have closed forms."""
    from mbsim.compile_model.contacts import (
        motion_bound_address,
        near_address,
        pair_address,
        region_address,
    )
    from mbsim.geometry.catalog import MOTION_BOUNDS, NEARS, PAIRS, REGIONS, RIGID_PAIRS

    for name in PAIRS:
        yield Task(name, functools.partial(pair_address, PAIRS[name]))
    for name in REGIONS:
        yield Task(f"{name} region", functools.partial(region_address, name))
    for name in NEARS:
        rows = PAIRS[name].slots
        yield Task(f"{name} apart", functools.partial(near_address, name, rows))
    for name in RIGID_PAIRS:
        yield Task(f"{name} rigid", functools.partial(pair_address, RIGID_PAIRS[name]))
    for name in MOTION_BOUNDS:
        yield Task(f"{name} motion bound", functools.partial(motion_bound_address, name))


def _runs(files: Sequence[str] | Iterator[str], methods: Sequence[str]) -> Iterator[Task]:
    """Yield short runs of models."""
    for file in files:
        for method in methods:
            yield Task(f"{Path(file).name} {method}", functools.partial(_run_file, file, method))


def _run_file(file: str, method: str) -> None:
    from mbsim.reader.xml import read_model

    _run(read_model(file), method)


def _run(model: Model, method: str) -> None:
    """Run a model for a moment.

    Raises
    ------
    MbsimError
        If it cannot be begun; what stops it later has compiled all that it needs.
    """
    from mbsim.run.simulation import simulate

    if not model.simulations:
        raise ModelError(f"{model.file}: no Simulate")
    end = max(PART * model.simulations[-1].end_time, 1e-9)
    simulate(model, integrator=method, end_time=end, print_interval=0.5 * end)


def _texts(methods: Sequence[str]) -> Iterator[Task]:
    """Yield short runs of the decks that are here for this alone."""
    from mbsim.warming.decks import DECKS

    for name, text in DECKS.items():
        for method in methods:
            yield Task(f"{name} {method}", functools.partial(_run_text, text, method))


def _run_text(text: str, method: str) -> None:
    from mbsim.reader.xml import read_model

    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "deck.xml"
        deck.write_text(text, encoding="utf-8")
        _run(read_model(str(deck)), method)


def _again(file: Path) -> None:
    """Ask a result file for signals that it does not hold."""
    from mbsim.reader.xml import read_model
    from mbsim.run.replay import request
    from mbsim.run.simulation import simulate

    model = read_model(str(file))
    with tempfile.TemporaryDirectory() as folder:
        with simulate(model, end_time=0.01, print_interval=0.005, output=folder) as results:
            request(results, [f"Force_Contact[{next(iter(model.contacts))}].force"])


def _solvers() -> Iterator[Task]:
    """Yield the solvers of frictional contact problems."""
    from mbsim.fclib.solvers.catalog import SOLVERS

    for name, (_, _, takes_rolling) in SOLVERS.items():
        for d in (2, 3):
            yield Task(f"FCLIB {name} {d}D", functools.partial(_solve, name, d))
        if takes_rolling:
            yield Task(f"FCLIB {name} rolling", functools.partial(_solve, name, 5))


def _solve(solver: str, d: int) -> None:
    """Solve some local problem of contacts in a row, and a global one, in d numbers a contact."""
    import numpy as np

    from mbsim.fclib.problem import Global, Local, matrix
    from mbsim.fclib.solve import solve

    count = 12
    m = d * count
    random = np.random.default_rng(1)
    half = random.normal(size=(m, m))
    own = half @ half.T / m + np.eye(m)
    q = random.normal(size=m) - 0.5
    mu, mu_r = np.full(count, 0.4), np.full(count, 0.1) if d == 5 else None
    local = Local(d, matrix(own), q, mu, mu_r=mu_r)
    whole = Global(d, matrix(np.eye(m)), matrix(half), random.normal(size=m), q, mu, mu_r=mu_r)
    for problem in (local, whole):
        solve(problem, solver=solver, max_seconds=1.0)


def refused(task: Task) -> str:
    """Do a task; return why it could not be done, or nothing."""
    try:
        task.do()
    except MbsimError as error:
        return str(error)
    return ""
