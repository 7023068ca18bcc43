"""What `mbsim info` says of a model's user subroutines: file, language, what they ask for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mbsim.model.elements import Subroutine
from mbsim.plugins.dependence import dependence
from mbsim.plugins.permission import named, not_run
from mbsim.plugins.source.find import find_either, find_source
from mbsim.plugins.source.octave import OctaveFile
from mbsim.plugins.source.script import Scripts, user_function
from mbsim.plugins.source.shared_library import Library, choose


def about(
    user: Subroutine,
    element: str,
    prefix: str,
    names: str,
    arguments: Sequence[Any],
    plugin_files: Sequence[Path],
    scripts: Scripts,
) -> dict[str, Any]:
    """Return facts of one subroutine.

    A script that `plugin_files` name is run, and its function called with iflag 1; one that only
    the deck names is not.

    Parameters
    ----------
    user : Subroutine
    element : str
        How messages name its element.
    prefix : str
        Of its attributes, or ROUTINE.
    names : str
        The documented names of its arguments.
    arguments : sequence
        What the call with iflag 1 is given.
    plugin_files, scripts
        As `friction.load_friction` takes them.

    Raises
    ------
    ModelError
        If the deck names a file that cannot be used.
    """
    facts: dict[str, Any] = {"function": user.fnc_name}
    if not (user.script_name or user.dll_name or plugin_files):
        return facts | {"file": "none; name one with --plugin FILE"}
    if not named(user, plugin_files):
        return facts | not_run(user)
    if prefix in ("usrsub", "ROUTINE"):
        source: Any = find_either(user, user.fnc_name, element, prefix, plugin_files, scripts)
    else:
        source = find_source(user, user.fnc_name, element, prefix, plugin_files, scripts)
    facts["file"] = str(source.path)
    if isinstance(source, Library):
        return facts | {"language": choose(source, user.fnc_name, prefix, user.language)[0]}
    if isinstance(source, OctaveFile):
        return facts | {"language": "MATLAB, by GNU Octave"}
    states = source.values.get("CFFSUB_STATES", 0) if prefix == "cff" else 0
    if isinstance(states, int) and states > 0:
        names, arguments = f"{names}, state", [*arguments, [0.0] * states]
        facts["states"] = states
    function = user_function(source, user.fnc_name, element, names)
    asked, why = dependence(function, arguments)
    facts["asks_for"] = asked or "nothing"
    if why:
        facts["iflag_call_fails"] = why
    return facts
