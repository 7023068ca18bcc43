"""What a shell completes an argument with: names of signals once a result file is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

_RESULT = ".h5"


def signal_names(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Return names of the last result file that was typed, or that files are meant.

    A name is completed up to its next ``/``, as a path is.
    """
    typed = [str(each) for value in ctx.params.values() for each in _listed(value)]
    files = [word for word in typed if word.endswith(_RESULT) and Path(word).is_file()]
    if not files:
        return [CompletionItem(incomplete, type="file")]
    from mbsim.errors import MbsimError
    from mbsim.results.names import parts_of
    from mbsim.results.reading import open_results

    try:
        with open_results(files[-1]) as results:
            names = [
                text
                for name, columns in results.signals().items()
                for text in (name, *(f"{name}/{part}" for part in parts_of(columns)))
            ]
    except MbsimError:
        return []
    found: dict[str, None] = {}
    for name in names:
        if name.startswith(incomplete):
            rest = name[len(incomplete) :]
            head, cut, _ = rest.partition("/")
            found[incomplete + head + cut] = None
    return [CompletionItem(name) for name in found]


def _listed(value: object) -> list[object]:
    return list(value) if isinstance(value, (tuple, list)) else [value]
