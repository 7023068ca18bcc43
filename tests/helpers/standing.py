"""The standing fuzz: random decks, each with three random checks; in `tests`,
`python -m helpers.standing --help` says how to run it.

A deck follows from its seed (`helpers.fuzz_scenes`). It is run, and run with its start pushed by
a part PUSH of its size, which says what the motion makes of a small error. Then three checks are
drawn: another method, a tighter tolerance, another system of units, or a change that must not
change the motion (`helpers.invariances`). A check fails where poses are apart by more than
AGREE tol times the growth of the push; where growth is above HORIZON only the rows before it are
compared, since nothing is reproducible after them. A run that ends in an exception of Python,
takes too long, or gives up is an offence, as is a warning of its audit.

Each deck's verdict is one line of a journal; a run that goes on with a journal leaves out the
seeds that are in it.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from helpers import fuzz_scenes, random_decks
from helpers.invariances import CHANGES
from helpers.random_decks import AGREE, PUSH, SIZE, UNITS

TOL = 1e-7
HORIZON = 1e5  # a push that grows more than this leaves nothing to compare
CHECKS = ("method", "tolerance", "units", *CHANGES)


def poses_of(found, ids):
    """Return positions and rotations of bodies by their id."""
    p, q = found.poses[..., :3], found.poses[..., 3:]
    return {
        b: (p[:, k], Rotation.from_quat(q[:, k], scalar_first=True).as_matrix())
        for k, b in enumerate(ids)
    }


def apart(one, other):
    """Return how far bodies are apart at each row, (rows,): of positions and of turns."""
    rows = min(len(p) for p, _ in one.values())
    far = np.zeros(rows)
    for body, (p, R) in one.items():
        at, axes = other[body]
        moved = np.linalg.norm(p[:rows] - at[:rows], axis=-1)
        turned = np.linalg.norm((R[:rows] - axes[:rows]).reshape(rows, 9), axis=-1) / np.sqrt(2.0)
        far = np.maximum(far, np.maximum(moved, turned))
    return far


def ids_of(text):
    """Return the ids of moving bodies, in order."""
    root = etree.fromstring(text.encode())
    return sorted(int(b.get("id")) for b in root.iter("Body_Rigid") if b.get("isground") is None)


class Case:
    """A seed's deck, its run, and how its motion grows."""

    def __init__(self, seed, folder, tol=TOL, seconds=60.0):
        self.seed, self.folder, self.tol, self.seconds = seed, Path(folder), tol, seconds
        self.text, self.said, self.units, self.method = fuzz_scenes.deck_of(seed)
        self.scale = SIZE / UNITS[self.units][1][2]
        self.offences, self.runs = [], 0
        self.plain = self.run("plain", self.text, self.method, tol)
        self.growth = None
        if self.plain.status != "ok":
            return
        self.poses = poses_of(self.plain, ids_of(self.text))
        pushes = random_decks.pushes(self.text, self.scale)
        pushed = self.run("pushed", self.text, self.method, tol, pushes)
        if pushed.status == "ok":
            far = apart(self.poses, poses_of(pushed, ids_of(self.text)))
            self.growth = np.maximum.accumulate(np.maximum(1.0, 2.0 * far / PUSH))

    def asked(self, method, tol):
        """Return the tolerance a method is given: an order of 2 takes far more steps."""
        return 100.0 * tol if method == "GALPHA" else tol

    def run(self, name, text, method, tol, overrides=(), scale=None):
        """Run a text and note what it ends with."""
        path = self.folder / f"fuzz_{self.seed}_{name}.xml"
        path.write_text(text, encoding="utf-8")
        scale = self.scale if scale is None else scale
        asked = self.asked(method, tol)
        found = random_decks.run(path, method, asked, scale, overrides, self.seconds)
        self.runs += 1
        who = f"{name} {method} {asked:g}"
        if found.status != "ok":
            self.offences.append((found.status.split(":")[0].split()[0], f"{who}: {found.status}"))
        self.offences += [("audit", f"{who}: {warning}") for warning in found.warnings]
        return found

    def check(self, name):
        """Do one check."""
        rng = np.random.default_rng([self.seed, CHECKS.index(name), 24])
        method, tol, text, scale = self.method, self.tol, self.text, self.scale
        expected, every = (lambda poses: poses), 1
        if name == "method":
            others = [m for m in fuzz_scenes.METHODS if m != method]
            method = str(rng.choice(others))
        elif name == "tolerance":
            tol = 0.01 * tol
        elif name == "units":
            number = (self.units + 1) % len(UNITS)
            text = fuzz_scenes.deck_of(self.seed, number)[0]
            scale = SIZE / UNITS[number][1][2]
        else:
            root = etree.fromstring(text.encode())
            turned = CHANGES[name](rng, root, self.scale)
            text = etree.tostring(root, encoding="unicode")
            every = 3 if name == "rows" else 1

            def expected(poses):
                """Return poses in the deck's unit of length, as changes ask for, and back."""
                long = {b: (p * self.scale, R) for b, (p, R) in poses.items()}
                return {b: (p / self.scale, R) for b, (p, R) in turned(long).items()}

        found = self.run(name, text, method, tol, scale=scale)
        if found.status != "ok" or self.growth is None:
            return
        seen = poses_of(found, ids_of(text))
        seen = {b: (p[::every], R[::every]) for b, (p, R) in seen.items()}
        far = apart(expected(self.poses), seen)
        loose = max(self.asked(method, tol), self.asked(self.method, self.tol))
        allowed = AGREE * loose * self.growth
        compared = self.growth < HORIZON
        worst = np.where(compared, far / allowed, 0.0)
        k = int(np.argmax(worst))
        if worst[k] > 1.0:
            self.offences.append(
                (
                    "disagree",
                    f"{name} {method} {self.asked(method, tol):g} and {self.method} are "
                    f"{far[k]:.3g} apart at row {k}, {self.growth[k]:.3g} growth",
                )
            )


def judge(seed, folder, tol=TOL, seconds=60.0, count=3):
    """Return the verdict of a seed: what its deck holds, its checks and offences."""
    drawn = np.random.default_rng([seed, 25]).choice(CHECKS, size=count, replace=False)
    case = Case(seed, folder, tol, seconds)
    checks = [str(name) for name in drawn]
    if case.plain.status == "ok":
        for name in checks:
            case.check(name)
    audits = [offence for offence in case.offences if offence[0] == "audit"]
    if audits and len(audits) == len(case.offences) and is_told(case, audits):
        case.offences = [("told", text) for _, text in audits]
    return {
        "seed": seed,
        "deck": case.said,
        "method": case.method,
        "checks": checks,
        "runs": case.runs,
        "offences": case.offences,
    }


def is_told(case, audits):
    """Return whether runs say of a law without potential, and all of them, what it gains."""
    kinds = [word for word in case.said.split() if word in random_decks.LAWLESS]
    return len(kinds) >= 2 and all("energy balance" in text for _, text in audits)


def main():
    """Judge seeds and write the journal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--start", type=int, default=0, help="first seed")
    parser.add_argument("--stop", type=int, default=2000, help="one behind the last seed")
    parser.add_argument("--journal", type=Path, default=Path("fuzz.jsonl"))
    parser.add_argument("--tol", type=float, default=TOL)
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU time a run may take")
    given = parser.parse_args()
    done = set()
    if given.journal.exists():
        done = {json.loads(line)["seed"] for line in given.journal.read_text().splitlines()}
    with tempfile.TemporaryDirectory() as folder, given.journal.open("a") as journal:
        for seed in range(given.start, given.stop):
            if seed in done:
                continue
            verdict = judge(seed, folder, given.tol, given.seconds)
            journal.write(json.dumps(verdict) + "\n")
            journal.flush()
            for kind, text in verdict["offences"]:
                print(seed, verdict["deck"], kind, text, sep=" | ", flush=True)
            for path in Path(folder).iterdir():
                path.unlink()


if __name__ == "__main__":
    main()
