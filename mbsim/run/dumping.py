"""Contacts of a run as frictional contact problems, for solvers of rigid contact: `--dump-fclib`.

MOREAU's steps solve such problems; those are written as they were solved
(`stepping.contact_problem`). Of compliant contacts, at the end of every N-th accepted step, the
problem of a time step h, that step's, is written as a local problem of FCLIB:

    u = W r + q,   W = H' T H,   q = H' (v + h a),

H the wrenches of unit impulses (normal, two tangents) at the contact points, T what accelerations
follow from forces, joints and constraint equations included, a the accelerations without contacts.
u_N >= 0 opens. What the contacts of the run push is in the file too, times h, as a guess.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.core.layout import AT_V, AT_W
from mbsim.errors import ModelError, ResultsError
from mbsim.geometry.catalog import AT_NORMAL, AT_POINT

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.run.loop import Runner

Array = np.ndarray[Any, Any]

#: Forces of unit wrenches are of this size times the lightest body's mass: accelerations of use.
_PUSH = 10.0


class ContactProblems:
    """Writes the contact problems of a run.

    One that was written already but for its scale and tol, as those of a scene at rest, is passed
    over.

    Parameters
    ----------
    name
        The model's.
    every
        Steps from one problem to the next.
    folder
        Where files go, `<model>-i<step>-<contacts>.hdf5`; it must hold none, unless `resumed`.
    maker
        Makes problems of steps.
    hardest
        How many to keep, those whose steps took most sweeps; None for all.
    """

    def __init__(
        self, name: str, every: int, folder: Path, maker: Maker, resumed: bool, hardest: int | None
    ) -> None:
        self.name, self.every, self.folder = name, every, folder
        self._maker, self._hardest, self.next = maker, hardest, every
        self._kept: list[Kept] = []
        for word, number in (("dump_fclib", every), ("dump_hardest", hardest)):
            if number is not None and number < 1:
                raise ModelError(f"{word}={number}: must be a whole number > 0")
        if hardest is not None and maker.sweeps is None:
            raise ModelError(
                "dump_hardest is for integrator MOREAU: other methods solve no contact problems"
            )
        self._swept = maker.sweeps() if maker.sweeps is not None else 0
        try:
            folder.mkdir(parents=True, exist_ok=True)
            there = sorted(folder.glob("*.hdf5"))
        except OSError as error:
            raise ResultsError(f"{folder}: {error.strerror}") from None
        if there and not resumed:
            raise ResultsError(
                f"{folder}: holds problems of an earlier run; move them, or choose another "
                "folder with -o"
            )
        self._kept = [_read(file) for file in there]
        self._kept.sort(key=lambda kept: kept.step)

    @property
    def written(self) -> int:
        """How many problems there are."""
        return len(self._kept)

    def watch(self, step: int, t: float, h: float, y: Array) -> None:
        """Write the problem if this step's turn has come, something touches and it is wanted."""
        sweeps = 0
        if self._maker.sweeps is not None:
            swept = self._maker.sweeps()
            sweeps, self._swept = swept - self._swept, swept
        if step < self.next:
            return
        self.next = step - step % self.every + self.every
        # a resumed run may come by a step again
        self._kept = [kept for kept in self._kept if kept.step != step]
        least = min(self._kept, key=lambda kept: (kept.sweeps, -kept.step), default=None)
        full = self._hardest is not None and len(self._kept) >= self._hardest
        if full and least is not None and sweeps <= least.sweeps:
            return
        made = self._maker.make(t, h, y)
        if made is None:
            return
        problem, guess = made
        form = Form(problem)
        others = self._kept if self._hardest is not None else self._kept[-1:]
        if any(form.is_same(kept.form, self._maker.tol) for kept in others):
            return
        from mbsim.fclib import hdf5

        if self._maker.sweeps is not None:
            said = f"{problem.info.description}, sweeps {sweeps}"
            problem = replace(problem, info=replace(problem.info, description=said))
        if full and least is not None:
            least.file.unlink(missing_ok=True)
            self._kept.remove(least)
        file = self.folder / f"{self.name}-i{step}-{problem.contacts}.hdf5"
        hdf5.write(file, problem, guesses=[guess])
        self._kept.append(Kept(step, sweeps, file, form))

    def begin_anew(self) -> None:
        """Take back all problems: the run begins anew."""
        for kept in self._kept:
            kept.file.unlink(missing_ok=True)
        self._kept, self.next = [], self.every


class Maker(NamedTuple):
    """What makes contact problems of steps.

    Attributes
    ----------
    make
        Returns problem and guess of the step h that ends at (t, y), given as (t, h, y); None where
        nothing touches.
    sweeps
        Sweeps and Newton iterations of the run so far; None where none are made.
    tol
        The run's.
    """

    make: Callable[[float, float, Array], tuple[Any, Any] | None]
    sweeps: Callable[[], int] | None
    tol: float


class Kept(NamedTuple):
    """A problem that was written."""

    step: int
    sweeps: int
    file: Path
    form: Form


class Form:
    """A contact problem but for its scale: W, and the direction of q.

    r(c q) = c r(q) for c > 0: Coulomb's law is one of cones.
    """

    def __init__(self, problem: Any) -> None:
        self.numbers: list[Array] = [problem.mu]
        if problem.kind == "local":
            q = problem.q
            matrices = [problem.W]
        else:
            from scipy.sparse.linalg import spsolve

            H = problem.H.csr()
            q = H.T @ spsolve(problem.M.csr().tocsc(), problem.f) + problem.w
            matrices = [problem.M, problem.H]
        for matrix in matrices:
            coordinates = matrix.csr().tocoo()
            self.numbers += [coordinates.row, coordinates.col, coordinates.data]
        size = float(np.abs(q).max(initial=0.0))
        self.numbers.append(q / size if size > 0.0 else q)

    def is_same(self, other: Form, tol: float) -> bool:
        """Return whether each number is the other's but for `tol` of the largest of its kind."""
        for mine, its in zip(self.numbers, other.numbers, strict=False):
            if mine.shape != its.shape:
                return False
            size = float(np.abs(mine).max(initial=0.0))
            if not bool((np.abs(mine - its) <= tol * size).all()):
                return False
        return len(self.numbers) == len(other.numbers)


def _read(file: Path) -> Kept:
    """Return a problem that an earlier part of the run wrote."""
    from mbsim.fclib import hdf5

    problem = hdf5.read(file).problem
    said = "" if problem.info is None else problem.info.description or ""
    step = re.search(r"-i(\d+)-\d+$", file.stem)
    sweeps = re.search(r"sweeps (\d+)", said)
    return Kept(
        int(step.group(1)) if step else 0,
        int(sweeps.group(1)) if sweeps else 0,
        file,
        Form(problem),
    )


class CompliantContacts:
    """Makes problems of what compliant contacts touch at the end of a step.

    Parameters
    ----------
    system
        What runs.
    evaluate
        Evaluates the model at (t, y): afterwards `Scene.work` holds forces and contacts.
    accelerate
        Fills y' of bodies on joints from the forces in `Scene.work`: (t, y, dy).
    """

    def __init__(
        self,
        system: System,
        evaluate: Callable[[float, Array], float],
        accelerate: Callable[[float, Array, Array], None],
    ) -> None:
        self.system, self._evaluate, self._accelerate = system, evaluate, accelerate
        for contact in system.model.contacts.values():
            if contact.rigid:
                # its equations would stand in W
                raise ModelError(
                    f"Force_Contact[{contact.id}]: dump_fclib does not go with "
                    'tangential_stiffness="INFINITE"; leave that out for this run'
                )

    def problem(self, t: float, h: float, y: Array) -> Any:
        """Return the problem of a step h from a state, and what contacts do there as a guess."""
        from mbsim.fclib.problem import Info, Local, Solution, matrix

        if self._evaluate(t, y) != 0.0:
            raise ModelError(f"time {t:.9g}: the model cannot be evaluated for --dump-fclib")
        work = self.system.scene.work
        hit = work.hit[: work.hit[-1]].copy()
        if len(hit) == 0:
            return None
        H, force = self._directions(y, hit)
        W, u = self._responses(t, h, y, H, H @ force)
        mu = np.array([self._friction(s, force[3 * k : 3 * k + 3]) for k, s in enumerate(hit)])
        info = Info(
            title=self.system.model.name,
            description=f"time {t!r}, step {h!r}",
            math_info="local frictional contact problem of one time step; joints are in W",
        )
        problem = Local(3, matrix(W), u, mu, info=info)
        return problem, Solution(u + W @ (h * force), h * force)

    def _directions(self, y: Array, hit: Array) -> tuple[Any, Array]:
        """Return H (6 nb, 3 nc), force then torque about the cg in global axes, and forces."""
        from scipy import sparse

        from mbsim.core.layout import BODY_SIZE
        from mbsim.dynamics.contact import forces as at

        scene = self.system.scene
        nb = len(scene.bodies.mass)
        rows, columns, values, force = [], [], [], np.zeros(3 * len(hit))
        for k, s in enumerate(hit):
            point = scene.work.points[s]
            p, n = point[AT_POINT : AT_POINT + 3], point[AT_NORMAL : AT_NORMAL + 3]
            tx = scene.work.t[s]
            axes = np.array([n, tx, np.cross(n, tx)])
            force[3 * k : 3 * k + 3] = axes @ scene.work.slot[s, at.FORCE : at.FORCE + 3]
            for g, sign in zip(at.sides(scene, s), (1.0, -1.0), strict=True):
                b = int(scene.graphics.body[g])
                if b == nb:
                    continue
                arm = p - y[BODY_SIZE * b : BODY_SIZE * b + 3]
                wrench = sign * np.hstack([axes, np.cross(arm, axes)])
                rows.append(np.tile(np.arange(6 * b, 6 * b + 6), 3))
                columns.append(np.repeat(np.arange(3 * k, 3 * k + 3), 6))
                values.append(wrench.ravel())
        shape = (6 * nb, 3 * len(hit))
        if not rows:
            return sparse.csc_array(shape), force
        coordinates = (np.concatenate(rows), np.concatenate(columns))
        return sparse.coo_array((np.concatenate(values), coordinates), shape=shape).tocsc(), force

    def _responses(self, t: float, h: float, y: Array, H: Any, pushed: Array) -> tuple[Any, Array]:
        """Return W, and the velocities q of the contacts after h without them."""
        from scipy import sparse

        from mbsim.core.layout import BODY_SIZE
        from mbsim.dynamics.contact import forces as at

        scene = self.system.scene
        nb, work = len(scene.bodies.mass), scene.work
        total = np.hstack([work.force[:nb], work.torque[:nb]])
        for s in work.hit[: work.hit[-1]]:
            # torques of the laws themselves are none of the impulses at the point
            for g, sign in zip(at.sides(scene, s), (1.0, -1.0), strict=True):
                b = int(scene.graphics.body[g])
                if b < nb:
                    total[b, 3:] -= sign * work.slot[s, at.TORQUE : at.TORQUE + 3]
        free = total.ravel() - pushed
        base = self._accelerations(t, y, free)
        bodies = y[: BODY_SIZE * nb].reshape(nb, BODY_SIZE)
        spin = np.einsum("bij,bj->bi", work.R[:nb], bodies[:, AT_W:])
        velocity = np.hstack([bodies[:, AT_V:AT_W], spin]).ravel()
        q = H.T @ (velocity + h * base)

        jointed = np.repeat(scene.tree.of_body[:nb] >= 0, 6)
        answers = self._inverse_masses() @ H
        if jointed.any():
            size = _PUSH * float(scene.bodies.mass.min())
            columns = []
            for c in range(H.shape[1]):
                wrench = H[:, [c]].toarray().ravel()
                moved = np.zeros(6 * nb)
                if wrench[jointed].any():
                    moved = (self._accelerations(t, y, free + size * wrench) - base) / size
                columns.append(np.where(jointed, moved, 0.0))
            keep = sparse.diags_array(np.where(jointed, 0.0, 1.0))
            answers = keep @ answers + sparse.csc_array(np.array(columns).T)
        W = (H.T @ answers).tocsr()
        W = 0.5 * (W + W.T)
        W.eliminate_zeros()
        return W.tocsr(), q

    def _inverse_masses(self) -> Any:
        """Return the inverse masses of single bodies, (6 nb, 6 nb), global axes."""
        from scipy import sparse

        scene = self.system.scene
        blocks = []
        for b, mass in enumerate(scene.bodies.mass):
            R = scene.work.R[b]
            blocks += [np.eye(3) / mass, R @ scene.bodies.inverse[b] @ R.T]
        return sparse.block_diag(blocks, format="csc")

    def _accelerations(self, t: float, y: Array, forces: Array) -> Array:
        """Return accelerations, linear then angular in global axes, under all forces (6 nb,)."""
        from mbsim.core.layout import BODY_SIZE

        scene = self.system.scene
        nb, work = len(scene.bodies.mass), scene.work
        given = forces.reshape(nb, 6)
        w = y[: BODY_SIZE * nb].reshape(nb, BODY_SIZE)[:, AT_W:]
        found = np.empty((nb, 6))
        for b in range(nb):
            R, inertia = work.R[b], scene.bodies.inertia[b]
            gyroscopic = np.cross(w[b], inertia @ w[b])
            found[b, :3] = given[b, :3] / scene.bodies.mass[b]
            found[b, 3:] = R @ (scene.bodies.inverse[b] @ (R.T @ given[b, 3:] - gyroscopic))
        if len(scene.tree.body):
            work.force[:nb], work.torque[:nb] = given[:, :3], given[:, 3:]
            dy = np.zeros(len(y))
            self._accelerate(t, y, dy)
            for row in np.flatnonzero(scene.tree.of_body[:nb] >= 0):
                b = int(row)
                at = BODY_SIZE * b + 7
                found[b] = np.hstack([dy[at : at + 3], work.R[b] @ dy[at + 3 : at + 6]])
        return found.ravel()

    def _friction(self, s: int, force: Array) -> float:
        """Return the coefficient of a slot: of sliding, or what a user's function gives there."""
        from mbsim.dynamics.contact.forces import contact_of
        from mbsim.laws.catalog import FRICTION_LAWS

        contact = self.system.model.contacts[
            self.system.contact_ids[int(contact_of(self.system.scene, s))]
        ]
        if contact.cff_type in FRICTION_LAWS:
            return float(contact.mu_dynamic)
        across = float(np.hypot(force[1], force[2]))
        return across / float(force[0]) if across > 0.0 and force[0] > 0.0 else 0.0


def problems_of(run: Runner) -> Maker:
    """Return what makes contact problems of steps of a run."""
    from mbsim.arrays.hooks import Joints

    rigid, name, tol = run.methods.rigid, run.system.model.name, run.settings.stages[0].tol
    if rigid is not None:
        from mbsim.stepping.contact_problem import contact_problem, sweeps_so_far

        stepping = rigid.stepping
        return Maker(
            lambda t, h, y: contact_problem(stepping, name, t),
            lambda: sweeps_so_far(stepping),
            tol,
        )
    idle = np.zeros(len(run.method.y))

    def evaluate(t: float, y: Any) -> float:
        return run.hooks.call(run.problem.rhs, t, 0.0, y, idle)

    def accelerate(t: float, y: Any, dy: Any) -> None:
        run.hooks.ask_joints(Joints.ACCELERATE, t, y, dy)

    return Maker(CompliantContacts(run.system, evaluate, accelerate).problem, None, tol)
