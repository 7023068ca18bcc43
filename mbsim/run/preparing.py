"""A model made ready to run: compiled, with what is said of it before its first step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mbsim import __version__
from mbsim.arrays.codes import SCALE_LENGTH
from mbsim.core.profile import part
from mbsim.errors import ModelError
from mbsim.integrators.catalog import RIGID
from mbsim.model.elements import Model
from mbsim.run.options import Notify
from mbsim.run.plants import with_plants
from mbsim.run.settings import Settings

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.compile_model.changes import Parameters
    from mbsim.results.log import RunLog


def _parameters(system: System, settings: Settings) -> list[Parameters]:
    """Return the parameters of every stage where commands change elements, else nothing."""
    given = [stage.simulation.changes for stage in settings.stages]
    if not any(given):
        return []
    from mbsim.compile_model.changes import make_room, parameters

    stages = [parameters(system, changes) for changes in given]
    system.scene = make_room(system.scene, stages)
    return stages


class Prepared(NamedTuple):
    """A model made ready to run: its arrays, and what is said of it."""

    system: System
    said: list[str]  # lines for the log
    attributes: dict[str, str | float | int]  # of a result file
    changes: list[Parameters]  # of every stage, where commands change elements


def check_plugins(files: Sequence[Path]) -> None:
    """Raise `ModelError` where a file of `plugins` is not there."""
    for file in files:
        if not file.is_file():
            raise ModelError(f"--plugin {file}: no such file")


def prepare(
    model: Model,
    settings: Settings,
    files: list[Path],
    detector: str,
    interpret: bool,
    scripts: bool,
    tell: Notify,
) -> Prepared:
    """Return a model as a system, having told the user what is about to run.

    Parameters
    ----------
    model : Model
    settings : Settings
    files : list of Path
        With user subroutines.
    detector, interpret, scripts
        As `detector`, `interpret_plugins` and `scripts` of `simulate`.
    tell : callable
        Called with lines for the user.
    """
    from mbsim.compile_model.build import build
    from mbsim.core import jit
    from mbsim.plugins.permission import no_scripts

    jit.on_first_compile = lambda: tell(
        "compiling what this model needs (a quarter of a minute to one); later runs load it"
    )
    jit.compiled = jit.expected = 0
    jit.on_plan = lambda: tell(_left(jit.expected - jit.compiled))
    check_plugins(files)
    said: list[str] = []
    with no_scripts(not scripts), part("build"):
        system = build(
            with_plants(model),
            files,
            interpret,
            detector,
            said.append,
            rigid=settings.integrator == RIGID,
        )
    changes = _parameters(system, settings)
    said += _announce(system, settings, said, tell)
    said += _unused(system, files, tell)
    return Prepared(
        system, said, _attributes(system, settings, detector, files, interpret), changes
    )


def begin_log(log: RunLog, system: System, notes: Iterable[str]) -> None:
    """Write what is said before the run, and let users' code write there."""
    for note in notes:
        log.line(note)
    if system.user_laws or system.subroutines or system.posts:
        from mbsim.plugins import host

        host.log = log.line


def _announce(system: System, settings: Settings, said: list[str], tell: Notify) -> list[str]:
    """Tell the user what is about to run; return the lines of it that are for the log as well."""
    for note in said:
        # what a script will probably fail at is for the terminal too
        if ": warning: " in note:
            tell(note)
    for note in settings.notes:
        tell(note)
    for number, user in system.user_laws:
        how = f"{user.how}: {user.reason}" if user.reason else user.how
        tell(f"Force_Contact[{number}]: {user.name} of {user.source.name}, {how}")
    more = []
    for post in system.posts:
        more.append(
            f"Force_Contact[{post.contact.id}]: {post.user.fnc_name} of "
            f"{post.source.name}, called at output times"
        )
        tell(more[-1])
    for user_subroutine in system.subroutines.values():
        statement, number = user_subroutine.element
        source = user_subroutine.source.name
        more.append(
            f"{statement}[{number}]: {user_subroutine.name} of {source}, {user_subroutine.how}"
        )
        tell(more[-1])
    return more


def _left(count: int) -> str:
    """Return how many functions are still to be compiled, in words."""
    return f"compiling: {count} functions are left" if count != 1 else "compiling: one is left"


def _unused(system: System, files: Sequence[Path], tell: Notify) -> list[str]:
    """Tell which files of `plugins` no element calls; return the lines, for the log as well."""
    called = {user.source.absolute() for _, user in system.user_laws}
    called |= {post.source.absolute() for post in system.posts}
    called |= {user.source.absolute() for user in system.subroutines.values()}
    called |= {user.source.absolute() for user in system.residuals.values()}
    unused = [
        f"--plugin {file}: no element calls a function of it"
        for file in files
        if file.absolute() not in called
    ]
    for line in unused:
        tell(line)
    return unused


def _attributes(
    system: System, settings: Settings, detector: str, files: list[Path], interpret: bool
) -> dict[str, str | float | int]:
    """Return what a result file says of its run."""
    model = system.model
    return {
        "mbsim_version": __version__,
        "model_file": model.file,
        "model_sha256": model.sha256,
        "units": f"{model.units.force} {model.units.mass} {model.units.length} {model.units.time}",
        "integrator": settings.integrator,
        "tol": settings.tol,
        "tol_from": settings.tolerances,
        "length": float(system.scene.world.scale[SCALE_LENGTH]),
        "end_time": settings.end_time,
        "print_interval": settings.stages[-1].simulation.print_interval,
        "detector": detector,
        # what `request` needs to make the same forces again
        "overrides": "\n".join(model.overrides),
        "plugins": "\n".join(map(str, files)),
        "interpret_plugins": int(interpret),
    }
