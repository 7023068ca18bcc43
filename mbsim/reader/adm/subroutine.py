r"""``FUNCTION=USER(1, 2.5)\ROUTINE=file.py::name``: user subroutines of an Adams deck."""

from __future__ import annotations

import os
from pathlib import Path

from mbsim.expressions.tree import Expression
from mbsim.model import elements as el
from mbsim.reader.adm.declare import LIBRARIES
from mbsim.reader.statement import Entry
from mbsim.reader.subroutine import result


def routine(entry: Entry, default: str, of: str = "") -> el.Subroutine | None:
    """Return the subroutine of a statement, None where its FUNCTION is none or is faulty.

    `default` is the name of the function where ROUTINE is not given, `of` what stands before both
    words, as NORMAL_ does. Of several functions it is the first.
    """
    function, named = f"{of}FUNCTION", f"{of}ROUTINE"
    par = entry.get(function)
    if not isinstance(par, tuple):
        if entry.given(named) and (par is not None or not entry.given(function)):
            entry.fault(f"belongs to {function}=USER(...), which is not given", named)
        return None
    given = entry.get(named, "")
    file, _, name = (given if isinstance(given, str) else given[0]).rpartition("::")
    if not entry.given(named):
        entry.note(f"not given; taken as {default}", named)
    script = ""
    if file:
        path = Path(file)
        path = path if path.is_absolute() else entry.draft.directory / path
        script = os.path.realpath(path)
        if not path.is_file():
            entry.fault("no such file (the path is relative to the deck)", named)
    if Path(script).suffix.lower() in LIBRARIES:
        return el.Subroutine(par, name or default, dll_name=script, source=entry.source)
    return el.Subroutine(par, name or default, script_name=script, interpreter="PYTHON")


def function_or_user(
    entry: Entry, statement: str, default: str
) -> tuple[Expression | None, el.Subroutine | None]:
    """Return what FUNCTION is as an expression, and the subroutine where that gives it."""
    user = routine(entry, default)
    if user is not None:
        return result(entry, statement, user), user
    return entry.get("FUNCTION"), None


def as_attributes(user: el.Subroutine, prefix: str) -> dict[str, str]:
    """Return a subroutine as attributes of XML, whose names begin with `prefix`."""
    par = ", ".join(map(repr, user.par))
    found = {f"{prefix}_param_string": f"USER({par})", f"{prefix}_fnc_name": user.fnc_name}
    if user.dll_name:
        return found | {f"{prefix}_dll_name": user.dll_name}
    return found | ({"script_name": user.script_name} if user.script_name else {})
