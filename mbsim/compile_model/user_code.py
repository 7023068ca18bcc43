"""The users' code that a model names, loaded, and its rows in the scene."""

from __future__ import annotations

import functools
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.model import Residuals, Users
from mbsim.compile_model.param_surfaces import Function
from mbsim.model.elements import Model
from mbsim.model.subroutines import wanted

if TYPE_CHECKING:
    from mbsim.plugins import UserFriction
    from mbsim.plugins.contact_post import ContactPost
    from mbsim.plugins.source.script import Script
    from mbsim.plugins.subroutine import UserSubroutine
    from mbsim.plugins.types import UserNormal, UserResidual


@dataclass(frozen=True)
class UserCode:
    """What users wrote: laws of contacts, CONTACTPOSTs, forces and variables, residuals."""

    friction: dict[int, UserFriction]  # by contact id
    normal: dict[int, UserNormal]  # by contact id
    posts: list[ContactPost]
    subroutines: dict[tuple[str, int], UserSubroutine]  # in place of expressions, row by row
    residuals: dict[int, UserResidual]  # by Force_Element
    surfaces: dict[int, Function]  # what gives points of each

    @property
    def laws_look(self) -> bool:
        """Whether a law of a contact looks at the state."""
        friction = any(law.looks for law in self.friction.values())
        return friction or any(law.looks for law in self.normal.values())

    @property
    def looks(self) -> bool:
        """Whether a law or a subroutine looks at the state."""
        return self.laws_look or any(user.looks for user in self.subroutines.values())


def _load_user_friction(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserFriction]:
    """Load the users' CFFSUBs; scenes without one do not import what that needs."""
    asked = [c for c in model.contacts.values() if c.asks_user]
    if not asked:
        return {}
    from mbsim.plugins import failure, host, load_friction
    from mbsim.plugins.subroutine import end_run

    end_run()  # an earlier one that failed while it was built
    failure.clear()
    host.forget()
    if log is not None:
        host.log = log
    return {c.id: load_friction(c, plugins, interpret, scripts, log) for c in asked}


def _load_user_normal(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserNormal]:
    """Load the users' CNFSUBs."""
    asked = [c for c in model.contacts.values() if c.cnf_type == "USERCNF"]
    if not asked:
        return {}
    from mbsim.plugins.normal import load_normal
    from mbsim.plugins.subroutine import begin_run, end_run

    if all(c.cff_type != "USERCFF" for c in model.contacts.values()):
        end_run()
    begin_run(log)
    return {c.id: load_normal(c, plugins, interpret, scripts, log) for c in asked}


def _load_posts(
    model: Model,
    plugins: Sequence[Path],
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> list[ContactPost]:
    """Load the users' CONTACTPOSTs."""
    asked = [c for c in model.contacts.values() if c.cpost is not None]
    if not asked:
        return []
    from mbsim.plugins.contact_post import load_post
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return [load_post(c, plugins, scripts) for c in asked]


def _load_subroutines(
    model: Model,
    plugins: Sequence[Path],
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[tuple[str, int], UserSubroutine]:
    """Load the users' subroutines that stand in place of expressions."""
    if not wanted(model):
        return {}
    from mbsim.compile_model.subroutines import load
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return load(model, plugins, scripts)


@functools.cache
def no_residuals() -> Residuals:
    """Return the rows of a model without elements of users' residuals: there is nothing in them."""
    return Residuals(*(np.zeros((0,) * axes, kind) for kind, axes in _residual_arrays()))


@functools.cache
def _residual_arrays() -> list[tuple[Any, int]]:
    """Return type and number of axes of the arrays of `Residuals`."""
    kinds = typing.get_type_hints(Residuals, include_extras=True).values()
    return [(kind.__metadata__[0], kind.__metadata__[1]) for kind in kinds]


def _load_residuals(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserResidual]:
    """Load the users' residuals."""
    if not model.force_elements:
        return {}
    from mbsim.plugins.residual import load_residual
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return {
        id: load_residual(element, plugins, interpret, scripts, log)
        for id, element in model.force_elements.items()
    }


def _load_surfaces(
    model: Model,
    plugins: Sequence[Path],
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, Function]:
    """Load the users' SURSUBs of surfaces that hold points."""
    asked = {point.surface_id for point in model.points_on_surfaces.values()}
    if not asked:
        return {}
    from mbsim.plugins.shapes import load_surface
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return {id: load_surface(model.surfaces[id], plugins, scripts, model.file) for id in asked}


def load_user_code(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
) -> UserCode:
    """Load all that users wrote for a model; `interpret`: without compiling it.

    Raises
    ------
    ModelError
        If a user subroutine cannot be found or loaded.
    """
    scripts: dict[Path, Script] = {}
    return UserCode(
        _load_user_friction(model, plugins, interpret, log, scripts),
        _load_user_normal(model, plugins, interpret, log, scripts),
        _load_posts(model, plugins, log, scripts),
        _load_subroutines(model, plugins, log, scripts),
        _load_residuals(model, plugins, interpret, log, scripts),
        _load_surfaces(model, plugins, log, scripts),
    )


def users_table(code: UserCode, model: Model, n: int) -> Users:
    """Return the rows of user subroutines and of residuals behind them; `n`: numbers of y."""
    users, made = code.subroutines, code.residuals
    counts = [user.count for user in users.values()]
    if made:
        from mbsim.compile_model.force_elements import results_of

        counts += [results_of(model.force_elements[id], user) for id, user in made.items()]
    addresses = [user.address for user in users.values()]
    return Users(
        np.array([*addresses, *(0 for _ in made)], dtype=np.int64),
        np.array([*(-1 for _ in users), *range(len(made))], dtype=np.int64),
        np.zeros((len(counts), max(counts, default=1))),
        np.zeros(1, dtype=np.int64),
        np.zeros(n if code.laws_look else 0),
    )
