"""Names of signals: their parts, wildcards, lists that stay short, and the nearest to a slip."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

#: What may follow a name, by the number of columns of the signal, and the column it is.
PARTS: dict[int, dict[str, int]] = {
    3: {"x": 0, "y": 1, "z": 2},
    4: {"w": 0, "x": 1, "y": 2, "z": 3},
    8: {f"F{k}": k - 1 for k in range(1, 9)},
}
#: How names of derivatives begin: ``sensitivity/<parameter>/<signal>``.
SENSITIVITY = "sensitivity/"
#: An element's id in the name of a parameter, ``Body_Rigid[2].mass``, is no wildcard.
_ID = re.compile(r"\[(\d+)\](?=\.)")
#: Most ids that a compact name spells out; more are ``*``.
_SPELLED = 6


def of_slope(name: str) -> tuple[str, str]:
    """Return parameter and signal of a derivative's name; of another signal itself, and no name."""
    if not name.startswith(SENSITIVITY):
        return "", name
    parameter, _, signal = name[len(SENSITIVITY) :].partition("/")
    return parameter, signal


def parts_of(columns: int) -> tuple[str, ...]:
    """Return what may follow the name of a signal with so many columns (1: nothing)."""
    return (*PARTS.get(columns, ()), *(("mag",) if columns == 3 else ()))


def order(name: str) -> list[tuple[int, int, str]]:
    """Return a sorting key that puts body 2 before body 10."""
    return [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in name.split("/")]


def is_pattern(name: str) -> bool:
    """Return whether a name has wildcards: ``*``, ``?`` or ``[...]``."""
    return any(character in _ID.sub("", name) for character in "*?[")


def matching(pattern: str, columns: Mapping[str, int]) -> list[str]:
    """Return the names that a pattern stands for, segment by segment between slashes.

    Parameters
    ----------
    pattern : str
        For example ``bodies/*/velocity/mag``.
    columns : mapping of str to int
        Names of signals and how many columns each has.
    """
    wanted = _ID.sub(r"[[]\1]", pattern.strip("/")).split("/")
    found = []
    for name in sorted(columns, key=order):
        segments = name.split("/")
        if _fits(segments, wanted):
            found.append(name)
        elif len(wanted) == len(segments) + 1 and _fits(segments, wanted[:-1]):
            parts = parts_of(columns[name])
            found += [f"{name}/{part}" for part in parts if fnmatchcase(part, wanted[-1])]
    return found


def _fits(segments: Sequence[str], wanted: Sequence[str]) -> bool:
    return len(segments) == len(wanted) and all(map(fnmatchcase, segments, wanted))


def compact(names: Iterable[str], kinds: Mapping[str, str] | None = None) -> dict[str, list[str]]:
    """Return the names with their ids taken together: ``bodies/{2,3}/position``.

    What stands in braces or as ``*`` can be typed: a shell expands the first, `plot` the second.

    Parameters
    ----------
    names : iterable of str
    kinds : mapping of str to str, optional
        What a name is; only names of one kind are taken together.

    Returns
    -------
    dict of str to list of str
        Short name -> the names that it stands for, sorted.
    """
    alike: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for name in sorted(set(names), key=order):
        key = tuple("#" if segment.isdecimal() else segment for segment in name.split("/"))
        kind = kinds[name] if kinds else ""
        alike.setdefault(key, {}).setdefault(kind, []).append(name)
    made: dict[str, list[str]] = {}
    for key, groups in alike.items():
        for same in groups.values():
            # a * would stand for the other kinds too
            most = len(same) if len(groups) == 1 else _SPELLED
            for first in range(0, len(same), most):
                some = same[first : first + most]
                made[_short(key, some)] = some
    return made


def _short(key: Sequence[str], names: Sequence[str]) -> str:
    """Return one name for names that differ in their ids."""
    if len(names) == 1:
        return names[0]
    ids = [segment for segment in map(_first_id, names) if segment]
    one_id = key.count("#") == 1 and len(ids) <= _SPELLED
    return "/".join(key).replace("#", "{" + ",".join(ids) + "}" if one_id else "*")


def _first_id(name: str) -> str:
    return next((segment for segment in name.split("/") if segment.isdecimal()), "")


def nearest(asked: str, names: Iterable[str]) -> list[str]:
    """Return up to three names that look like the one asked for, nearest first."""
    return difflib.get_close_matches(asked, list(names), n=3, cutoff=0.5)


def by_label(asked: str, labels: Mapping[str, int]) -> str | None:
    """Return a name whose second part is a label, ``bodies/ball/velocity``, with the id instead.

    `labels` are those of the elements of the name's group, with their ids.
    """
    group, _, rest = asked.partition("/")
    part, _, last = rest.partition("/")
    folded = {label.casefold(): id for label, id in labels.items() if label}
    id = folded.get(part.casefold())
    return None if id is None else f"{group}/{id}/{last}".rstrip("/")
