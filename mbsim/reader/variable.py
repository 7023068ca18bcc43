"""Reference_Variable: an expression with a name."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.kinds import EXPRESSION, FLAG, TEXT
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import GIVEN_BY, USERSUB, expression_or_user


def _build_variable(entry: Entry) -> None:
    """Add a variable."""
    expr, user = expression_or_user(entry, "VARIABLE", "VARSUB")
    if expr is None:
        return
    variable = el.Variable(
        id=entry.get("id", 0),
        expr=expr,
        label=entry.get("label", ""),
        user=user,
        source=entry.source,
    )
    entry.register("variables", variable)


REFERENCE_VARIABLE = Statement(
    "Reference_Variable",
    {
        **NAMED,
        "type": GIVEN_BY,
        "expr": Spec(EXPRESSION, "its value"),
        **USERSUB,
        "is_implicit": Spec(
            FLAG,
            refused="implicit variables are documented but not built yet",
            harmless="false",
        ),
        **{
            name: Spec(TEXT, note="belongs to implicit variables; this one is explicit")
            for name in ("autobalance", "penalty", "penalty1", "dot_form", "ic", "static_hold")
        },
    },
    _build_variable,
    about="an expression with a name, used as VARVAL(id)",
)
