"""Statements of forces between two markers, in both languages, as `forces.catalog` has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mbsim.forces.catalog import FORCES, ForceKind, Parameter
from mbsim.model import elements as el
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import (
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    REALS,
    BadValueError,
    Kind,
    keyword,
)
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement


def kind_of(parameter: Parameter) -> Kind:
    """Return what an attribute may be, or one number of it."""
    if parameter.words:
        return keyword(spellings(**dict.fromkeys(parameter.words, "")))
    if parameter.signed:
        return REAL
    return POSITIVE if parameter.positive else NOT_NEGATIVE


def _several(count: int) -> Kind:
    """Return the kind of so many numbers, separated by blanks or commas."""

    def parse(text: str) -> tuple[float, ...]:
        values: tuple[float, ...] = REALS.parse(text)
        if len(values) != count:
            raise BadValueError
        return values

    return Kind(f"{count} numbers", parse)


def add_force(
    entry: Entry,
    kind: ForceKind,
    values: Mapping[str, Any],
    i: int,
    j: int,
    words: Mapping[str, str],
) -> None:
    """Check the values of an element and add it; `words` are its attributes as the deck has them.

    Attributes that must be given and are not have the value None, and their fault already.
    """
    needed = [each.name for each in kind.parameters if not each.optional]
    if all(values[name] is not None for name in needed):
        for finding in kind.check(values):
            say = entry.warn if finding.warns else entry.fault
            say(finding.message, words.get(finding.attribute, finding.attribute))
    force = el.MarkerForce(
        id=entry.get("id", 0),
        kind=kind.name,
        label=entry.get("label", ""),
        i_marker_id=i,
        j_marker_id=j,
        parameters=tuple(values.items()),
        source=entry.source,
    )
    entry.register(entry.draft.marker_forces.setdefault(kind.name, {}), force)


def _statement(kind: ForceKind) -> Statement:
    """Return the XML statement of a kind."""

    def build(entry: Entry) -> None:
        values = {each.name: entry.get(each.name, each.default) for each in kind.parameters}
        i, j = entry.get("i_marker_id", 0), entry.get("j_marker_id", 0)
        add_force(entry, kind, values, i, j, {})

    attributes = {
        **NAMED,
        **MARKERS,
    }
    for each in kind.parameters:
        found = Spec(
            kind_of(each) if each.count == 1 else _several(each.count),
            each.about,
            each.unit,
            f"{each.default:g}" if isinstance(each.default, float) else each.shown,
            alias=each.alias,
        )
        needed = each.default is None and not each.optional
        attributes[each.name] = replace(found, required=needed)
    attributes |= {name: Spec(refused=why) for name, why in kind.refused.items()}
    return Statement(kind.statement, attributes, build, about=kind.about)


def marker_forces() -> list[Statement]:
    """Return the XML statements of all kinds that have no reader of their own."""
    return [_statement(kind) for name in FORCES if not (kind := FORCES[name]).table]
