"""`mbsim check`: read a deck and find every fault, without running it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from mbsim.cli.messages import counted, echo
from mbsim.cli.options import set_option

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


def _repair(model: str, overrides: tuple[str, ...]) -> None:
    """Write mended copies of the deck's meshes that are no solids."""
    from pathlib import Path

    from mbsim.errors import ModelError
    from mbsim.model.mesh_repair import repair
    from mbsim.reader.xml import read_graphics

    refused = []
    for graphic in read_graphics(model, overrides):
        if graphic.vertices is None or graphic.faces is None:
            continue
        name = f"Post_Graphic[{graphic.id}]"
        try:
            done, target = repair(graphic, Path(model))
        except ModelError as error:
            refused.append(f"{name}: {error}")
            continue
        for line in done:
            echo(f"{name}: {line}")
        if target is None:
            echo(f"{name}: bounds a solid, nothing to mend")
        else:
            echo(f'{name}: written in the deck\'s unit of length: file="{target}"')
    if refused:
        raise ModelError("\n".join(refused))


def _meshes(deck: Model) -> Iterator[str]:
    """Yield what each mesh of a contact or of a body with density is."""
    from mbsim.model.mass_properties import polyhedron
    from mbsim.model.mesh import solid_fault
    from mbsim.model.mesh_findings import crossing_findings

    for graphic in deck.graphics.values():
        vertices, faces = graphic.vertices, graphic.faces
        if vertices is None or faces is None:
            continue
        x, y, z = vertices.max(axis=0) - vertices.min(axis=0)
        text = f"Post_Graphic[{graphic.id}]: {len(faces)} triangles, {x:g} x {y:g} x {z:g}"
        fault = solid_fault(vertices, faces)
        if fault:
            yield f"{text}, a picture only: {fault}"
            continue
        yield f"{text}, volume {polyhedron(vertices, faces).volume:.6g}"
        for finding in crossing_findings(vertices, faces):
            yield f"Post_Graphic[{graphic.id}]: warning: {finding}"


@click.command("check")
@click.argument("model", type=click.Path())
@set_option("Change an attribute first")
@click.option("--repair", is_flag=True, help="Write mended copies of meshes that are no solids.")
def command(model: str, overrides: tuple[str, ...], repair: bool) -> None:
    """Check MODEL: every fault is listed with file and line.

    Says what is in the model and how each pair of shapes will be tested. With --repair it looks
    at the meshes alone.
    """
    if repair:
        _repair(model, overrides)
        return
    from mbsim.cli.messages import warn
    from mbsim.compile_model.acting import check_expressions
    from mbsim.compile_model.pairing import plan_pairs, why_costly
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
    numbers = ", ".join(counted(count, name) for name, count in counts(deck).items())
    echo(f"ok: {model}: {numbers}")
    echo(f"  units {units_text(deck)}")
    for contact_id in deck.contacts:
        for text in pair_texts(plans, contact_id):
            echo(f"  Force_Contact[{contact_id}]: {text}")
    costly = Counter((plan.kind.contact, why_costly(deck, plan)) for plan in plans.pairs)
    for (contact_id, why), count in costly.items():
        if why:
            echo(f"  Force_Contact[{contact_id}]: costly, {counted(count, 'pairs')}: {why}")
    for text in _meshes(deck):
        echo(f"  {text}")
    for element in _without_file(deck):
        echo(f"  {element}: its subroutine names no file; a run needs --plugin FILE.py")
    if not deck.simulations:
        more = " and --print-interval" if is_adams(deck.file) else ""
        echo(f"  no Simulate: a run needs --end-time{more}")
    for line in sequence(deck):
        echo(f"  {line}")
    from mbsim.stepping.refusals import serves_better

    advice = [said] if (said := serves_better(deck)) else []
    for note in (*deck.notes, *notes, *advice):
        echo(f"  note: {note}")
