"""What a shell completes an argument with: names that a result file gives, once it is named."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    from mbsim.results.reading import Results

_RESULT = ".h5"


def signal_names(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Return names of the last result file that was typed, or that files are meant.

    A name is completed up to its next ``/``, as a path is.
    """
    from mbsim.results.names import parts_of

    def names(results: Results) -> Iterator[str]:
        for name, columns in results.signals().items():
            yield from (name, *(f"{name}/{part}" for part in parts_of(columns)))

    found = _names(ctx, names)
    if found is None:
        return [CompletionItem(incomplete, type="file")]
    return _up_to(found, incomplete, "/")


def request_names(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Return what `mbsim request` takes of the contacts of the result file that was typed.

    A name is completed up to its next ``.`` or ``/``; incidents by their first.
    """
    from mbsim.run.replay import OF_CONTACTS, OF_INCIDENTS

    def names(results: Results) -> Iterator[str]:
        for contact in results.ids("contacts"):
            known = OF_CONTACTS | {f"incident[0].{name}": n for name, n in OF_INCIDENTS.items()}
            for name, count in known.items():
                parts = ("x", "y", "z", "mag") if count == 3 else ()
                yield from (
                    f"Force_Contact[{contact}].{name}{part}"
                    for part in ("", *(f"/{p}" for p in parts))
                )

    return _up_to(_names(ctx, names) or [], incomplete, "./")


def _names(ctx: click.Context, names: Callable[[Results], Iterable[str]]) -> list[str] | None:
    """Return names of the last result file that was typed, None where none was."""
    typed = [str(each) for value in ctx.params.values() for each in _listed(value)]
    files = [word for word in typed if word.endswith(_RESULT) and Path(word).is_file()]
    if not files:
        return None
    from mbsim.errors import MbsimError
    from mbsim.results.reading import open_results

    try:
        with open_results(files[-1]) as results:
            return list(names(results))
    except MbsimError:
        return []


def _up_to(names: Iterable[str], incomplete: str, marks: str) -> list[Any]:
    """Return what names go on with, up to the next of some marks."""
    found: dict[str, None] = {}
    for name in names:
        if name.startswith(incomplete):
            rest = name[len(incomplete) :]
            end = min(
                (k + 1 for k, letter in enumerate(rest) if letter in marks), default=len(rest)
            )
            found[incomplete + rest[:end]] = None
    return [CompletionItem(name) for name in found]


def _listed(value: object) -> list[object]:
    return list(value) if isinstance(value, (tuple, list)) else [value]
