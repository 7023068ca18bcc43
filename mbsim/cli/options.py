"""Options that several commands have."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

#: How names of result files end.
RESULT_SUFFIXES = (".h5", ".hdf5")

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def plugin_option(what: str) -> Decorator:
    """Return --plugin, which a command takes as `plugins`; `what` such a file is."""
    return click.option(
        "--plugin",
        "plugins",
        multiple=True,
        type=click.Path(path_type=Path),
        metavar="FILE",
        help=f"{what}; may be repeated.",
    )


def set_option(what: str) -> Decorator:
    """Return --set for attributes of a deck, which a command takes as `overrides`."""
    return click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="SELECTOR=VALUE",
        help=f"{what}, e.g. Force_Contact[1].mu_static=0.3; may be repeated.",
    )


def json_option(what: str) -> Decorator:
    """Return --json, which a command takes as `as_json`; `what` it prints."""
    return click.option("--json", "as_json", is_flag=True, help=f"Print {what}.")


def folder_option(what: str, default: str) -> Decorator:
    """Return -o for a folder, which a command takes as `output`; `what` it is for."""
    return click.option(
        "-o",
        "output",
        type=click.Path(path_type=Path),
        metavar="DIR",
        help=f"Folder for {what}.  [default: {default}]",
    )


def resume_option(what: str) -> Decorator:
    """Return --resume; `what` it does."""
    return click.option("--resume", is_flag=True, help=f"{what}.")


workers_option = click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Processes on this machine.  [default: one a processor]",
)
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Let a Dask cluster run them, e.g. tcp://host:8786; its page shows what goes on.",
)


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """Raise `click.UsageError` where both are given."""
    if scheduler is not None and workers is not None:
        raise click.UsageError("--workers are of this machine: not with --scheduler")


progress_option = click.option(
    "--progress",
    type=click.Choice(["auto", "off"]),
    default="auto",
    show_default=True,
    help="auto: shown where standard error is a terminal.",
)
