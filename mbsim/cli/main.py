"""`mbsim`: finds the subcommand, and turns errors into one message and an exit code."""

from __future__ import annotations

import importlib
import sys

import click

from mbsim import __version__
from mbsim.errors import MbsimError

#: Subcommand -> its line in `mbsim --help`; each lives in the module of its name.
_COMMANDS = {
    "run": "Run a model; results go to a folder.",
    "check": "Read and check a model; list every fault with file and line.",
    "info": "Say what is in a model or a result file.",
}


class _Commands(click.Group):
    """A group that imports a subcommand only when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"mbsim.cli.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="mbsim")
def group() -> None:
    """Multibody contact simulation from MotionSolve-style decks."""


def main() -> None:
    """Run the command line; the entry point of the `mbsim` script."""
    try:
        group(prog_name="mbsim", standalone_mode=False)
    except click.exceptions.Abort:
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except MbsimError as error:
        click.echo(f"mbsim: error: {error}", err=True)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        # whoever read our output went away: nothing more to say, and nothing to flush to
        sys.stdout = None
        sys.exit(0)
