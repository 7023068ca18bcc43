"""User subroutines as a statement names them: values, function, file."""

from __future__ import annotations

import os
from dataclasses import fields

from mbsim.expressions.tree import Expression, UserResult
from mbsim.model import elements as el
from mbsim.reader.keywords import BY_EXPRESSION, BY_USERSUB, spellings
from mbsim.reader.kinds import TEXT, USER, keyword
from mbsim.reader.statement import Entry, Spec

LANGUAGE = keyword(spellings(C="", FORTRAN=""))
#: Attributes of a statement that takes a user subroutine in place of an expression.
USERSUB = {
    "usrsub_param_string": Spec(USER, "par of the user's function; it stands for expressions"),
    "usrsub_fnc_name": Spec(TEXT, "name of the user's function", "", "see below"),
    "usrsub_dll_name": Spec(TEXT, "its shared library, relative to the deck, or NULL", "", "NULL"),
    "usrsub_language": Spec(LANGUAGE, "C or FORTRAN, where the library's names do not tell"),
    "script_name": Spec(TEXT, "its file, relative to the deck; or --plugin"),
    "interpreter": Spec(TEXT, "its language", "", "PYTHON"),
}
BY_EITHER = keyword({**BY_EXPRESSION, **BY_USERSUB})
#: How an element says which of both gives it.
GIVEN_BY = Spec(BY_EITHER, "how it is given", "", "by what is given")


def subroutine(entry: Entry, prefix: str, default: str, libraries: bool = True) -> el.Subroutine:
    """Return the user subroutine of an element.

    Parameters
    ----------
    entry : Entry
    prefix : str
        Of its attributes: ``cff``, ``cnf``, ``cpost``, ``usrsub``.
    default : str
        The function, where ``<prefix>_fnc_name`` does not name one.
    libraries : bool
        Whether it may be of a shared library.
    """
    dll = _library(entry, prefix, libraries)
    named = f"{prefix}_script_name" if entry.given(f"{prefix}_script_name") else "script_name"
    script = entry.get(named, "")
    if script:
        path = entry.beside(script)
        script = os.path.realpath(path)
        if not path.is_file():
            entry.fault("no such file (the path is relative to the deck)", named)
    # a script of its own has an interpreter of its own
    spoken = "PYTHON" if named != "script_name" else entry.get("interpreter", "PYTHON")
    if not entry.given(f"{prefix}_fnc_name"):
        entry.note(f"not given; taken as {default}", f"{prefix}_fnc_name")
    return el.Subroutine(
        par=entry.get(f"{prefix}_param_string", ()),
        fnc_name=entry.get(f"{prefix}_fnc_name", default),
        dll_name=dll,
        script_name="" if dll else script,
        interpreter=entry.get(f"{prefix}_interpreter", spoken),
        language=entry.get(f"{prefix}_language", ""),
        source=entry.source if dll else el.Source(),
    )


def _library(entry: Entry, prefix: str, libraries: bool) -> str:
    """Return the shared library that an element names, empty where it names none."""
    name = f"{prefix}_dll_name"
    dll = entry.get(name, "NULL").strip()
    if dll.upper() in ("", "NULL"):
        return ""
    if not libraries:
        entry.fault('a shared library cannot be named here; "NULL" names no file', name)
        return ""
    path = entry.beside(dll)
    # decks of several systems leave the suffix out
    files = [path, *(path.with_name(path.name + suffix) for suffix in (".so", ".dylib", ".dll"))]
    found = next((file for file in files if file.is_file()), None)
    if found is None:
        entry.fault("no such file (the path is relative to the deck)", name)
        return ""
    return os.path.realpath(found)


def expression_or_user(
    entry: Entry, kind: str, default: str
) -> tuple[Expression | None, el.Subroutine | None]:
    """Return what ``expr`` is, and the subroutine where that gives it; faults go to the entry.

    Parameters
    ----------
    entry : Entry
    kind : str
        Of the element, as `expressions.tree.UserResult` has it.
    default : str
        The function, where the deck names none.
    """
    if not by_user(entry, type=entry.get("type", "")):
        return entry.get("expr"), None
    user = subroutine(entry, "usrsub", default)
    return result(entry, kind, user), user


def by_user(entry: Entry, expressions: tuple[str, ...] = ("expr",), type: str = "") -> bool:
    """Return whether a user subroutine stands in place of an element's expressions.

    `type` is what the deck's ``type`` says of it, empty where it says something else. Fault
    attributes of the other way, and an element that gives neither.
    """
    given = [name for name in USERSUB if entry.given(name)]
    found = [name for name in expressions if entry.given(name)]
    user = type == "USERSUB" or (type == "" and bool(given))
    for name in found if user else given:
        other = "a user subroutine" if user else "an expression"
        entry.fault(f"this element is given by {other}; must not be there", name)
    if user and "usrsub_param_string" not in given:
        entry.fault(f"usrsub_param_string: missing; must be {USER.allowed}")
    if not user and not found and len(expressions) == 1:
        entry.fault(f"{expressions[0]}: missing; must be an expression, or usrsub_param_string")
    return user


def relation(user: el.Subroutine, count: int) -> el.RelationSubroutine:
    """Return the subroutine of a relation of so many displacements: COUSUB, COUXX and COUXX2.

    Where it has another name, those of derivatives are this with XX and XX2 behind.
    """
    name = "COU" if user.fnc_name == "COUSUB" else user.fnc_name
    return el.RelationSubroutine(
        **{each.name: getattr(user, each.name) for each in fields(el.Subroutine)},
        count=count,
        first=f"{name}XX",
        second=f"{name}XX2",
    )


def result(entry: Entry, statement: str, user: el.Subroutine, component: int = 0) -> Expression:
    """Return what a user subroutine gives as an expression, with a text for messages."""
    values = ", ".join(f"{value:g}" for value in user.par)
    tree = UserResult(statement, entry.get("id", 0), component)
    return Expression(f"USER({values}) by {user.fnc_name}", tree)
