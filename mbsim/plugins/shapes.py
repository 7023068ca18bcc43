"""Users' functions of surfaces, SURSUB: asked for points when a model is built, never in a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from mbsim.errors import PluginError
from mbsim.model.curves import ParamSurface
from mbsim.model.names import element_name, is_adams
from mbsim.plugins.returned import NotAForce, numbers
from mbsim.plugins.source.find import find_script
from mbsim.plugins.source.script import Scripts, user_function

#: Names of the arguments, in order; iord 0 asks for the point.
SURSUB = "id, par, npar, u, v, iord, iflag"


def load_surface(
    surface: ParamSurface, plugin_files: Sequence[Path], scripts: Scripts, deck: str = ""
) -> Callable[[float, float], list[float]]:
    """Return what gives the point of a surface at u and v.

    Raises
    ------
    ModelError
        If the file or the function cannot be used.
    PluginError
        By what is returned, if the function raises or returns no three numbers.
    """
    user, title = surface.user, element_name(deck, "Reference_ParamSurface", surface.id)
    prefix = "ROUTINE" if is_adams(deck) else "usrsub"
    script = find_script(user, user.fnc_name, title, prefix, plugin_files, scripts)
    function = user_function(script, user.fnc_name, title, SURSUB)
    par = list(user.par)

    def at(u: float, v: float) -> list[float]:
        try:
            result = function(surface.id, par, len(par), float(u), float(v), 0, False)
            return numbers(result, 3, " [x, y, z]")
        except NotAForce as error:
            message = f"{title}: {user.fnc_name} at u {u:g}, v {v:g} {error} ({script.path})"
        except Exception as error:  # users' code may raise anything
            kind = type(error).__name__
            message = f"{title}: {user.fnc_name} failed at u {u:g}, v {v:g}: {kind}: {error}"
            raise PluginError(f"{message} ({script.path})") from error
        raise PluginError(message)

    return at
