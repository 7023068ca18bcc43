"""`mbsim report`: a run as one HTML page."""

from __future__ import annotations

from pathlib import Path

import click

from mbsim.cli.messages import echo


@click.command("report")
@click.argument("file", type=click.Path(path_type=Path), metavar="RESULT.h5")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="FILE.html",
    help="The page.  [default: <result>-report.html]",
)
def command(file: Path, output: Path | None) -> None:
    """Write what RESULT.h5 tells as one HTML page: motion, curves, contacts, audit, settings, deck.

    It needs no other file and no network, and prints well.
    """
    from mbsim.results.products import said_size

    target = output or Path(f"{file.stem}-report.html")
    write_report(file, target)
    echo(f"{target}: {said_size(target)}")


def write_report(file: Path, target: Path) -> None:
    """Write the report of a result file."""
    from mbsim.results.opening import read_apart
    from mbsim.results.products import check_product, write_product
    from mbsim.results.reading import open_results
    from mbsim.view.report import report

    check_product(target, "page")

    def read() -> str:
        with open_results(file) as results:
            return report(results)

    write_product(target, read_apart(read, file), "page")
