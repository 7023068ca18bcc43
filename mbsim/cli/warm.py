"""`mbsim warm`: compile ahead, for this machine or for a family of processors."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import echo

if TYPE_CHECKING:
    from mbsim.warming.tasks import Task


@click.command("warm")
@click.argument("models", nargs=-1, type=click.Path(), metavar="[MODEL]...")
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="Every law, pair of shapes, joint, method and FCLIB solver; of MODELs every method.",
)
@click.option(
    "--target",
    metavar="FAMILY",
    help="Code for a family of processors, e.g. x86-64-v3, to be shipped; with -o.",
)
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for that code; MBSIM_SHIPPED_CODE=DIR has it read.",
)
def command(
    models: tuple[str, ...], everything: bool, target: str | None, output: Path | None
) -> None:
    """Compile what MODELs need (default: most models), so that first runs begin at once."""
    if (target is None) != (output is None):
        raise click.UsageError("--target and -o go together")
    if target is not None and output is not None:
        _ship(target, output, [*models, *(["--all"] if everything else [])])
        return
    from mbsim.core import code_cache, jit
    from mbsim.errors import ResultsError
    from mbsim.warming.bytecode import keep_bytecode
    from mbsim.warming.tasks import refused, tasks

    nothing_kept = ResultsError(f"{code_cache.cache_root()}: compiled code cannot be kept there")
    code_cache.trusted_root()
    if not code_cache.is_kept():
        raise nothing_kept  # now, not after minutes
    began = time.perf_counter()
    before = jit.total
    keep_bytecode()  # where it cannot be kept, starts take longer, and nothing else
    todo = tasks(everything, models)
    failed = _do_all(todo, refused)
    for line in failed:
        echo(f"mbsim: warning: {line}", err=True)
    echo(
        f"{jit.total - before} functions compiled in {time.perf_counter() - began:.0f} s; "
        f"they are in {jit.cache_root()}"
    )
    if failed and len(failed) == len(todo):
        from mbsim.errors import ModelError

        raise ModelError("nothing of it could be run")
    if not code_cache.is_kept():
        raise nothing_kept


def _do_all(todo: Sequence[Task], refused: Callable[[Task], str]) -> list[str]:
    """Do all tasks behind a progress bar, and return what failed."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    from mbsim.core import jit

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}"),
        TextColumn("{task.fields[now]}"),
    )
    failed: list[str] = []
    with Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        refresh_per_second=4,
        disable=not sys.stderr.isatty(),
    ) as bar:
        line = bar.add_task("", total=len(todo), now="")
        jit.on_compile = lambda name: bar.update(line, now=name)
        for task in todo:
            bar.update(line, description=task.name, now="")
            why = refused(task)
            if why:
                failed.append(f"{task.name}: {why}")
            bar.advance(line)
        jit.on_compile = None
    return failed


def _ship(family: str, output: Path, arguments: list[str]) -> None:
    """Compile in a process that takes its processor to be of a family.

    Numba asks for the processor once, when it is imported.
    """
    from mbsim.core import processors
    from mbsim.errors import MbsimError, ResultsError

    folder = output / processors.folder_of(family)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"{folder}: cannot be made: {error.strerror}") from None
    environment = {
        **os.environ,
        **processors.settings(family),
        "MBSIM_CACHE_DIR": str(folder.resolve()),
    }
    done = subprocess.run([sys.executable, "-m", "mbsim", "warm", *arguments], env=environment)
    if done.returncode != 0:
        raise MbsimError(f"compiling for {family} ended with exit code {done.returncode}")
    # what was compiled of users' functions is found without their text
    shutil.rmtree(folder / "plugins", ignore_errors=True)
