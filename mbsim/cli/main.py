"""`mbsim`: the group of subcommands, and how errors become messages and exit codes."""

from __future__ import annotations

import atexit
import contextlib
import gc
import io
import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from mbsim import __version__
from mbsim.cli.messages import echo, printable, with_severity
from mbsim.errors import DeckError, Interrupted, MbsimError, ModelError, ResultsError

#: Subcommand -> module; each module has a click command named `command`.
COMMANDS = {
    "new": "mbsim.cli.new",
    "run": "mbsim.cli.run",
    "check": "mbsim.cli.check",
    "info": "mbsim.cli.info",
    "plot": "mbsim.cli.plot",
    "view": "mbsim.cli.view",
    "report": "mbsim.cli.report",
    "sweep": "mbsim.cli.sweep",
    "identify": "mbsim.cli.identify",
    "bench": "mbsim.cli.bench",
    "request": "mbsim.cli.request",
    "plot-law": "mbsim.cli.plot_law",
    "fclib": "mbsim.cli.fclib",
    "warm": "mbsim.cli.warm",
    "manual": "mbsim.cli.manual",
}


#: So many new objects the collector lets come, in a process that runs one command.
_ALLOCATIONS = 100_000


class Commands(click.Group):
    """Subcommands by name; errors that a user can act on end without a traceback."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a subcommand."""
        module = COMMANDS.get(cmd_name)
        if module is None:
            return None
        command: click.Command = import_module(module).command
        command.epilog = f"More: mbsim manual {cmd_name}"
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the subcommand; of a name that is none the nearest is said."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            import difflib

            near = difflib.get_close_matches(args[0], COMMANDS, n=1)
            if near:
                said = f"{error.message} Did you mean {near[0]}?"
                raise click.UsageError(said, ctx) from None
            raise

    def main(self, *args: Any, **options: Any) -> Any:
        """Run a command line, standard streams that are closed being those of the null device.

        A result file would else get their number, and what is printed.
        """
        # what a command imports lives to its end: looking through it takes a tenth of a small run
        gc.set_threshold(_ALLOCATIONS)
        # and so it is when Python takes its modules apart
        atexit.register(gc.freeze)
        for number in range(3):
            try:
                os.fstat(number)
            except OSError:
                os.open(os.devnull, os.O_RDWR)
        for name in ("stdout", "stderr"):
            if getattr(sys, name) is None:
                setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))
        with _messages_may_be_lost():
            try:
                return super().main(*args, **options)
            except OSError as error:  # before a subcommand begins
                _no_output(error)
                sys.exit(ResultsError.exit_code)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the subcommand; a message and the exit code of the class for every MbsimError."""
        try:
            return super().invoke(ctx)
        except click.ClickException as error:
            # it holds what was typed
            vars(error)["message"] = printable(error.message)
            raise
        except MbsimError as error:
            for line in _messages(error):
                echo(with_severity("error", line), err=True)
            if pages := pages_of(error, ctx.invoked_subcommand or ""):
                line = "; ".join(f"mbsim manual {page}" for page in pages)
                echo(f"mbsim: see: {line}", err=True)
            ctx.exit(error.exit_code)
        except BrokenPipeError:
            # whoever read our output has seen enough; nothing is left to flush to it
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)
        except OSError as error:
            _no_output(error)
            ctx.exit(ResultsError.exit_code)
        except MemoryError:
            echo("mbsim: error: there is not enough memory", err=True)
            ctx.exit(ModelError.exit_code)
        except KeyboardInterrupt:
            echo("mbsim: error: interrupted", err=True)
            ctx.exit(Interrupted.exit_code)


class _Messages(io.FileIO):
    """Standard error as bytes; what it does not take is lost."""

    def write(self, data: Any) -> int:
        """Write bytes."""
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


@contextlib.contextmanager
def _messages_may_be_lost() -> Iterator[None]:
    """Let a command go on where nobody can read its messages: its standard error is on a full disk.

    Only the process's own; what another has put in its place is left alone.
    """
    plain = sys.stderr
    if plain is not sys.__stderr__ or plain is None:
        yield
        return
    raw = _Messages(plain.fileno(), "w", closefd=False)
    sys.stderr = heard = io.TextIOWrapper(
        io.BufferedWriter(raw), plain.encoding, plain.errors, line_buffering=True
    )
    try:
        yield
    finally:
        heard.flush()
        sys.stderr = plain


def _no_output(error: OSError) -> None:
    """Say why standard output cannot be written; files of ours raise `MbsimError`."""
    echo(f"mbsim: error: standard output: {error.strerror}", err=True)
    # nothing is left to flush to it
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


#: Pages named below a message; more would hide it.
_MOST_PAGES = 3


def pages_of(error: MbsimError, command: str = "") -> list[str]:
    """Return the pages of the manual that tell more about an error."""
    from mbsim.manual.errors import about

    texts = []
    if isinstance(error, DeckError):
        texts = [
            f"{Path(fault.file).suffix}:{fault.line}: {fault.element}" for fault in error.faults
        ]
    return about(type(error), texts or [str(error)], command)[:_MOST_PAGES]


def _messages(error: MbsimError) -> list[str]:
    """Return what to print, line by line: all faults of a deck, else one message."""
    if isinstance(error, DeckError):
        return [str(fault) for fault in error.faults]
    return [str(error)]


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="mbsim")
def main() -> None:
    """Multibody contact simulation from MotionSolve-style decks.

    `mbsim manual` is the manual; `mbsim manual TOPIC` a page, or a search.

    Exit codes: 0 done; 2 wrong usage or model; 3 the solver gave up; 4 a user subroutine
    failed; 5 results could not be written or read; 130 Ctrl-C, 143 SIGTERM, 129 SIGHUP: results
    up to there kept.
    """


if __name__ == "__main__":
    main()
