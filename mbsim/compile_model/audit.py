"""The arrays by which a run judges itself: which bodies are free, how far friction may go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Applied, Connections, Contacts, Equations, Markers
from mbsim.arrays.state import Audit
from mbsim.laws.catalog import friction_law_of
from mbsim.model.elements import Contact

Rows = np.ndarray[Any, Any]
#: Forms of forces that are friction in a joint.
FRICTIONS = (
    codes.SLIDE_FRICTION,
    codes.TURN_FRICTION,
    codes.SCREW_FRICTION,
    codes.BALL_FRICTION,
)


def _cone(contact: Contact, with_user: bool) -> float:
    """Return the largest friction over normal force, inf where the law has no such limit.

    That are laws with a viscous part, those that carry a bristle, and users' own.
    """
    if with_user or contact.cff_type in ("USERCFF", "COULOMB_OFF"):
        return math.inf
    law = friction_law_of(contact)
    if (law.carried > 0 and not law.modes) or dict(contact.friction).get("viscous_coef", 0.0) > 0.0:
        return math.inf
    mus = [getattr(contact, name) for name in ("mu_static", "mu_dynamic") if name in law.parameters]
    return max(mus, default=math.inf)


def _ties(
    connections: Connections, equations: Equations, applied: Applied, body: Rows
) -> list[tuple[int, ...]]:
    """Return the bodies between which joints, equations and forces act, ground being the last."""
    ground = int(body[0]) if len(body) else 0
    found = [
        tuple(int(body[m]) if m >= 0 else ground for m in pair)
        for group in (connections, applied)
        for pair in zip(group.i, group.j, strict=True)
    ]
    found += [(int(body[applied.i[f]]), ground) for f in np.flatnonzero(applied.alone)]
    # what the sum of an equation ties, it ties all of
    for e in range(len(equations.program)):
        terms = range(equations.first[e], equations.first[e + 1])
        if equations.slot[e] < 0:
            ends = [m for k in terms for m in (equations.i[k], equations.j[k])]
            found.append(tuple(int(body[m]) if m >= 0 else ground for m in ends))
    return found


def audit(
    contacts: list[Contact],
    with_user: set[int],
    group: Rows,
    mechanism: tuple[Connections, Equations, Applied, Markers],
    pulled: bool,
    laws: Contacts,
    friction_at: Rows,
) -> Audit:
    """Return what a run keeps to judge itself.

    Parameters
    ----------
    contacts : list of Contact
    with_user : set of int
        Ids of contacts with a user's friction.
    group : ndarray, shape (nb,)
        Number of the group of connected bodies of each moving body.
    mechanism : tuple of arrays
    pulled : bool
        Whether gravity changes with time: then momentum is not looked at.
    laws : Contacts
    friction_at : ndarray, shape (nc,)
        Where in y the work of friction of each contact stands.
    """
    connections, equations, applied, markers = mechanism
    ties = _ties(connections, equations, applied, markers.body)
    groups = int(group.max(initial=-1)) + 1
    tied = np.full(groups, int(pulled), dtype=np.int64)
    nb = len(group)
    for tie in ties:
        if nb in tie:
            tied[[group[b] for b in tie if b < nb]] = 1
    nc = len(contacts)
    tally = np.zeros(codes.TALLIES)
    tally[codes.ANEW] = 1.0
    # below 0: never looked at
    found = np.tile([-1.0, 1.0, 0.0, -1.0], (codes.AUDITS, 1))
    return Audit(
        tied,
        np.array([_cone(contact, contact.id in with_user) for contact in contacts]),
        np.array([1.0, 0.0, math.inf]),
        tally,
        np.zeros((groups, 7)),
        np.zeros((groups, 13)),
        np.array([int(np.argmax(group == g)) for g in range(groups)], dtype=np.int64),
        np.zeros((nc + 1, 4)),
        np.zeros(4),
        friction_at,
        # of built-in laws none but those with memory looks at X
        ((laws.memory > 0) | (laws.reads_x == 1) & _in(contacts, with_user)).astype(np.int64),
        np.array([form in FRICTIONS for form in applied.form.tolist()], dtype=np.int64)
        | (applied.keeps == 1),
        np.zeros((nc, 3)),
        np.zeros(len(applied.form)),
        found,
    )


def _in(contacts: list[Contact], ids: set[int]) -> Rows:
    """Return which contacts are among ids."""
    return np.array([contact.id in ids for contact in contacts], dtype=bool)
