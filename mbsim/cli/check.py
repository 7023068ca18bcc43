"""`mbsim check`: read a deck and find every fault, without running it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import echo

if TYPE_CHECKING:
    from mbsim.model.elements import Model


def _without_file(deck: Model) -> Iterator[str]:
    """Yield forces and variables whose user subroutine is in no file that the deck names."""
    from mbsim.forces.catalog import Components, Expressed, OfResidual, of_form

    kinds = of_form(Expressed, Components, OfResidual)
    for name, table in (
        *((kind.statement, deck.table(kind.name)) for kind in kinds),
        ("Reference_Variable", deck.variables),
    ):
        for element in table.values():
            if element.user is not None and not element.user.script_name:
                yield f"{name}[{element.id}]"


@click.command("check")
@click.argument("model", type=click.Path())
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="SELECTOR=VALUE",
    help="Change an attribute first, e.g. Force_Contact[1].mu_static=0.3; may be repeated.",
)
def command(model: str, overrides: tuple[str, ...]) -> None:
    """Check MODEL: every fault is listed with file and line.

    Says what is in the model and how each pair of shapes will be tested.
    """
    from mbsim.cli.messages import warn
    from mbsim.compile_model.acting import check_expressions
    from mbsim.compile_model.pairing import plan_pairs
    from mbsim.model.names import is_adams
    from mbsim.plugins import check_libraries
    from mbsim.reader.xml import read_model
    from mbsim.run.settings import settle

    deck = read_model(model, overrides)
    plans = plan_pairs(deck)
    check_expressions(deck)
    check_libraries(deck.contacts.values())
    # values that a run would refuse; times may still come from the command line
    notes = settle(deck).notes if deck.simulations else ()

    from mbsim.results.log import counts, pair_texts, sequence, units_text

    warn(deck.warnings)
    numbers = ", ".join(f"{count} {name}" for name, count in counts(deck).items())
    echo(f"ok: {model}: {numbers}")
    echo(f"  units {units_text(deck)}")
    for contact_id in deck.contacts:
        for text in pair_texts(plans, contact_id):
            echo(f"  Force_Contact[{contact_id}]: {text}")
    for element in _without_file(deck):
        echo(f"  {element}: its subroutine names no file; a run needs --plugin FILE.py")
    if not deck.simulations:
        more = " and --print-interval" if is_adams(deck.file) else ""
        echo(f"  no Simulate: a run needs --end-time{more}")
    for line in sequence(deck):
        echo(f"  {line}")
    for note in (*deck.notes, *notes):
        echo(f"  note: {note}")
