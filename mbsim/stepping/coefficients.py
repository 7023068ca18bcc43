"""What a Force_Contact says of rigid contact: friction by slip speed, and restitution.

A friction law is asked for its force at many slip speeds, of a built-in law as of a user's
function. Where it first reaches its largest value contact sticks up to that: regularised laws rise
there, from 0, only because they cannot hold. Above that speed the coefficient is the law's own.
"""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.golden import minimum
from mbsim.errors import ModelError
from mbsim.laws.abi import (
    FRICTION_INPUTS,
    LOCI_IN,
    MEMORY_OUT,
    NFORCE_IN,
    TIME_IN,
    X_IN,
    XDOT_IN,
)
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.laws.impact_test import impact_of
from mbsim.model.names import element_name
from mbsim.stepping.arrays import (
    DROPS,
    FIRST_SPEED,
    RESTITUTION,
    RULE_NUMBERS,
    SLOWEST,
    STICKING,
    Rules,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsim.compile_model.build import System
    from mbsim.model.elements import Contact

#: Slip speeds and coefficients of friction there, (rows, 2).
Knots = np.ndarray[Any, np.dtype[np.float64]]

_LAW = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p
)
#: Numbers of memory of any law at most, with those that it carries.
_MEMORY = max(FRICTION_LAWS[name].memory + FRICTION_LAWS[name].carried for name in FRICTION_LAWS)
#: Slip speeds at which a law is asked, over its group's speed: from, to, and how many.
SLOWEST_ASKED, FASTEST_ASKED, ASKED = 1e-7, 1e2, 721
#: A slip, over the group's speed, up to which what gives before it slips is at rest.
AT_REST = 1e-12
#: What friction may change by where a law looks at what rigid contact does not know.
SAME = 1e-6
#: Part of the largest coefficient from which on contact slips.
NEARLY = 1.0 - 1e-3
#: Between knots a coefficient is straight to this part of the largest one; speeds that differ by
#: less than a part of them are one: it jumps there.
STRAIGHT, ONE_SPEED = 1e-5, 1e-9


class Coefficients:
    """The rigid contacts of a system, with what the log is to say of them."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.said: list[str] = []
        contacts = [system.model.contacts[id] for id in system.contact_ids]
        self._number = np.zeros((len(contacts), RULE_NUMBERS))
        self._tables: dict[tuple[Any, ...], tuple[float, float, Knots]] = {}
        knots = []
        for c, contact in enumerate(contacts):
            number = self._number[c]
            knots.append(self._friction(c, contact))
            drop = number[STICKING] - knots[c][0, 1]
            number[DROPS] = float(drop > (1.0 - NEARLY) * number[STICKING])
            number[RESTITUTION] = self._restitution(c, contact)
            if contact.cnf_type == "POISSON":
                number[SLOWEST] = contact.normal_trans_vel
        first = np.concatenate([[0], np.cumsum([len(rows) for rows in knots])]).astype(np.int64)
        self.rules = Rules(self._number, first, np.concatenate([np.zeros((0, 2)), *knots]))

    def _name(self, contact: Contact) -> str:
        return element_name(self.system.model.file, "Force_Contact", contact.id)

    def _speed(self, c: int) -> float:
        """Return V of the group of bodies by which a contact is judged."""
        return self.system.speeds[int(self.system.scene.scales.of_contact[c])]

    def _load(self, c: int) -> float:
        """Return a usual force of a contact: m V^2/L of its group, m of the heaviest body."""
        scales = self.system.scene.scales
        g = int(scales.of_contact[c])
        return float(scales.mass[g]) * self._speed(c) ** 2 / float(scales.length[g])

    def _refuse(self, contact: Contact, why: str) -> ModelError:
        """Return what says that a contact cannot be rigid."""
        where = f"{self.system.model.file}:{contact.source.line}: {self._name(contact)}"
        return ModelError(f"{where}: integrator MOREAU {why}")

    def _friction(self, c: int, contact: Contact) -> Knots:
        """Fill the coefficients of friction of a contact; return those of what slides."""
        number = self._number[c]
        if contact.cff_type == "COULOMB_OFF":
            number[FIRST_SPEED] = math.inf
            return np.zeros((1, 2))
        known = contact.cff_type in FRICTION_LAWS
        if known and contact.asks_user and FRICTION_LAWS[contact.cff_type].memory:
            # it is asked for what slides, from within a law that keeps how it was stretched
            raise self._refuse(contact, f"reads no CFFSUB beside cff_type={contact.cff_type}")
        if known and not contact.asks_user:
            law = FRICTION_LAWS[contact.cff_type]
            if law.of_area:
                raise self._refuse(
                    contact, f"has no friction against spin, which cff_type={law.name} is"
                )
            if dict(contact.friction).get("rolling_arm", 0.0) > 0.0:
                raise self._refuse(
                    contact, f"has no friction against rolling, which cff_type={law.name} is"
                )
            if law.memory:
                # what such a law keeps is the give that rigid contact has not
                number[FIRST_SPEED] = AT_REST * self._speed(c)
                number[STICKING] = max(contact.mu_static, contact.mu_dynamic)
                self.said.append(
                    f"{self._name(contact)}: {law.name} as Coulomb's law: it sticks up to "
                    f"{number[STICKING]:g} and slides with {contact.mu_dynamic:g}"
                )
                return np.array([[number[FIRST_SPEED], contact.mu_dynamic]])
        elif contact.asks_user and self.system.user_friction[contact.id].states > 0:
            raise self._refuse(contact, "takes no friction with states")
        return self._table(c, contact)

    def _table(self, c: int, contact: Contact) -> Knots:
        """Fill the coefficients by asking the contact's function; return those of what slides."""
        number, table = self._number[c], self.system.scene.contacts
        group = int(self.system.scene.scales.of_contact[c])
        law = (contact.asks_user and contact.id, int(table.friction_law[c]))
        key = (*law, table.friction_par[c].tobytes(), group)
        if key not in self._tables:
            self._tables[key] = self._ask(c, contact)
        number[FIRST_SPEED], number[STICKING], knots = self._tables[key]
        return knots

    def _ask(self, c: int, contact: Contact) -> tuple[float, float, Knots]:
        """Return up to which slip a contact sticks, its coefficient then, and those beyond."""
        usual = self._speed(c)
        speeds = usual * np.geomspace(SLOWEST_ASKED, FASTEST_ASKED, ASKED)
        mu = np.array([self._asked(c, contact, v) for v in speeds])
        peak = int(mu.argmax())
        top = float(mu[peak])
        if 0.0 < top and 0 < peak < ASKED - 1:
            least, _ = minimum(
                lambda v: -self._asked(c, contact, v),
                speeds[peak - 1],
                speeds[peak + 1],
                relative=ONE_SPEED,
            )
            top = max(-least, top)
        first = int(np.argmax(mu >= NEARLY * top)) if top > 0.0 else 0
        if top > 0.0 and speeds[first] > usual:
            raise self._refuse(
                contact,
                f"cannot read a coefficient of friction: it still grows at a slip of {usual:.3g}",
            )
        if contact.asks_user:
            self.said.append(
                f"{self._name(contact)}: {contact.cff.fnc_name} gives a coefficient of friction "
                f"of {top:.4g} up to a slip of {speeds[first]:.3g}, {mu[-1]:.4g} where that is fast"
            )
        samples = np.column_stack([speeds, mu])[first:]
        knots = knots_of(lambda v: self._asked(c, contact, v), samples, STRAIGHT * top)
        return float(speeds[first]), top, knots

    def _call(self, c: int, contact: Contact, **changes: Any) -> np.ndarray[Any, Any]:
        """Return Fx, Fy, ... of the contact's law with these inputs changed."""
        table = self.system.scene.contacts
        given, out = np.zeros(FRICTION_INPUTS + _MEMORY), np.zeros(MEMORY_OUT + _MEMORY)
        given[NFORCE_IN] = changes.get("normal", self._load(c))
        given[XDOT_IN : XDOT_IN + 2] = changes["slip"]
        given[TIME_IN], given[X_IN] = changes.get("time", 0.0), changes.get("x", 0.0)
        given[LOCI_IN : LOCI_IN + 3] = changes.get("place", 0.0)
        par = np.ascontiguousarray(table.friction_par[c])
        law = _LAW(int(table.friction_law[c]))
        if law(contact.id, given.ctypes.data, par.ctypes.data, out.ctypes.data) != 0:
            raise self._refuse(contact, "cannot ask its friction function, which failed")
        return out / given[NFORCE_IN]

    def _asked(self, c: int, contact: Contact, v: float) -> float:
        """Return the coefficient of friction at a slip speed; raise where there is none."""
        usual = self._call(c, contact, slip=(v, 0.0))
        mu = -float(usual[0])
        if contact.asks_user:
            others = {
                "X": self._call(c, contact, slip=(v, 0.0), x=1e-3)[0],
                "the time": self._call(c, contact, slip=(v, 0.0), time=1.0)[0],
                "LOCI": self._call(c, contact, slip=(v, 0.0), place=1.0)[0],
                "more than the size of the normal force": self._call(
                    c, contact, slip=(v, 0.0), normal=3.0 * self._load(c)
                )[0],
                "the direction of slip": self._call(c, contact, slip=(0.0, v))[1],
            }
            for what, other in others.items():
                if not abs(other - usual[0]) <= SAME * max(abs(mu), 1e-3):
                    raise self._refuse(
                        contact,
                        f"cannot read a coefficient of friction: {contact.cff.fnc_name} looks at "
                        f"{what} (asked at a slip of {v:.3g})",
                    )
        if not mu >= 0.0:
            raise self._refuse(
                contact,
                f"cannot read a coefficient of friction: at a slip of {v:.3g} it is {mu:.3g}",
            )
        return mu

    def _restitution(self, c: int, contact: Contact) -> float:
        """Return the coefficient of restitution of a contact."""
        if contact.cnf_type == "POISSON":
            return float(contact.restitution_coef or 0.0)
        if contact.cnf_type not in NORMAL_LAWS or contact.cnf_type == "VOLUME":
            raise self._refuse(
                contact, f"cannot read a restitution from cnf_type={contact.cnf_type}"
            )
        if contact.restitution_coef is not None and contact.cnf_type in ("HERTZ", "HUNT_CROSSLEY"):
            return float(contact.restitution_coef)
        speed, mass = self._impact(c, contact)
        e = rebound(self.system, contact, speed, mass)
        self.said.append(
            f"{self._name(contact)}: restitution {e:.3g}, which its {contact.cnf_type} has at a "
            f"closing speed of {speed:.3g} and a mass of {mass:.3g}"
        )
        return e

    def _impact(self, c: int, contact: Contact) -> tuple[float, float]:
        """Return the closing speed and the mass (F = m a) at which a contact is looked at."""
        scene, system = self.system.scene, self.system
        body = dict(zip(system.graphic_ids, scene.graphics.body.tolist(), strict=True))
        moving = len(scene.bodies.mass)

        def inverse(ids: tuple[int, ...]) -> float:
            rows = [body[id] for id in ids if body[id] < moving]
            found = [1.0 / float(scene.bodies.mass[b]) for b in rows]
            return float(np.median(found)) if found else 0.0

        mass = 1.0 / (inverse(contact.i_graphics_id) + inverse(contact.j_graphics_id))
        if contact.ref_velocity is not None:
            return float(contact.ref_velocity), mass
        return self._speed(c), mass


def knots_of(asked: Callable[[float], float], samples: Knots, straight: float) -> Knots:
    """Return knots of a coefficient: between them it is straight to `straight`.

    Samples (rows, 2) by rising speeds are the begin. Where a curve is not straight between two it
    is asked between them, until it is; rows that the line through others says as well go.
    """
    rows = [(float(v), float(mu)) for v, mu in samples[:1]]
    for right in samples[1:]:
        ends = [(float(right[0]), float(right[1]))]
        while ends:
            (a, mu_a), (b, mu_b) = rows[-1], ends[-1]
            middle = 0.5 * (a + b)
            mu = asked(middle) if b - a > ONE_SPEED * b else 0.5 * (mu_a + mu_b)
            if abs(mu - 0.5 * (mu_a + mu_b)) > 0.5 * straight:
                ends.append((middle, mu))
            else:
                rows.append(ends.pop())
    return thinned(np.array(rows), 0.5 * straight)


def thinned(rows: Knots, most: float) -> Knots:
    """Return those of the rows (v, mu) that keep the curve between them within `most` of all."""
    kept = [0]
    while kept[-1] < len(rows) - 1:
        begin, low, high = kept[-1], -math.inf, math.inf
        last = begin + 1
        for k in range(begin + 1, len(rows)):
            way = rows[k, 0] - rows[begin, 0]
            slope = (rows[k, 1] - rows[begin, 1]) / way
            if low <= slope <= high:
                last = k
            low = max(low, slope - most / way)
            high = min(high, slope + most / way)
            if low > high:
                break
        kept.append(last)
    return rows[kept]


def rebound(system: System, contact: Contact, speed: float, mass: float) -> float:
    """Return the rebound of a mass that meets a contact's normal law at a speed, over that."""
    from mbsim.laws.constants import normal_constants

    law = NORMAL_LAWS[contact.cnf_type]
    if law.of_shapes:
        raise ModelError(
            f"{system.model.file}:{contact.source.line}: Force_Contact[{contact.id}]: give "
            "restitution_coef and ref_velocity for integrator MOREAU"
        )
    return impact_of(law, tuple(normal_constants(law, contact).tolist()), speed, mass).rebound
