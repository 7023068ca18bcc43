"""An Adams statement read as the XML statement that it stands for: one set of checks."""

from __future__ import annotations

from collections.abc import Mapping

from mbsim.reader.parse import Attribute, Node
from mbsim.reader.statement import Entry, Statement


def read_as(
    entry: Entry,
    statement: Statement,
    names: Mapping[str, str],
    fixed: Mapping[str, str] | None = None,
) -> None:
    """Read an entry of an Adams deck as a statement of XML.

    Parameters
    ----------
    entry : Entry
        The Adams statement, its own values checked.
    statement : Statement
        What it becomes.
    names : mapping of str to str
        Argument of Adams -> attribute. What is not given is left out.
    fixed : mapping of str to str, optional
        Attribute -> value that follows from the statement itself.
    """
    node = Node(statement.name, entry.node.line)
    for attribute in entry.node.attributes:
        if attribute.name == "id":
            node.attributes.append(attribute)
        elif attribute.name in names and entry.get(attribute.name) is not None:
            text = written(entry.get(attribute.name))
            name = names[attribute.name]
            node.attributes.append(Attribute(name, text, attribute.line, attribute.origin))
    for name, value in (fixed or {}).items():
        node.attributes.append(Attribute(name, value, entry.node.line))
    statement.read(node, entry.draft)


def written(value: object) -> str:
    """Return a value as XML decks write it."""
    if isinstance(value, tuple):
        return " ".join(written(each) for each in value)
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return repr(value) if isinstance(value, float) else str(value)
