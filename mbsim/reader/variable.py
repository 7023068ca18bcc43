"""Reference_Variable: an expression with a name."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.kinds import EXPRESSION
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import BY_EITHER, USERSUB, by_user, result, subroutine


def _build_variable(entry: Entry) -> None:
    """Add a variable."""
    user = None
    if by_user(entry, type=entry.get("type", "")):
        user = subroutine(entry, "usrsub", "VARSUB")
    expr = entry.get("expr") if user is None else result(entry, "VARIABLE", user)
    if expr is None:
        return
    variable = el.Variable(
        id=entry.get("id", 0),
        expr=expr,
        label=entry.get("label", ""),
        user=user,
        source=entry.source,
    )
    entry.register(entry.draft.variables, variable)


REFERENCE_VARIABLE = Statement(
    "Reference_Variable",
    {
        **NAMED,
        "type": Spec(BY_EITHER, "how it is given", "", "by what is given"),
        "expr": Spec(EXPRESSION, "its value"),
        **USERSUB,
    },
    _build_variable,
    about="an expression with a name, used as VARVAL(id)",
)
