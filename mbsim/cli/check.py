"""`mbsim check`: read a deck and find every fault, without running it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from mbsim.cli.messages import counted, echo, print_json, split_place, warn
from mbsim.cli.options import set_option
from mbsim.errors import DeckError, MbsimError

if TYPE_CHECKING:
    from mbsim.model.elements import Model

#: An element with which a message begins: ``Force_Contact[301]: ``.
_ELEMENT = re.compile(r"([A-Z]\w+(?:\[[^\]]*\])?): ")


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


def _meshes(deck: Model) -> Iterator[tuple[str, str]]:
    """Yield meshes of contacts and of bodies with density, and what each is."""
    from mbsim.model.mass_properties import polyhedron
    from mbsim.model.mesh import solid_fault
    from mbsim.model.mesh_findings import crossing_findings

    for graphic in deck.graphics.values():
        vertices, faces = graphic.vertices, graphic.faces
        if vertices is None or faces is None:
            continue
        x, y, z = vertices.max(axis=0) - vertices.min(axis=0)
        name, text = f"Post_Graphic[{graphic.id}]", f"{len(faces)} triangles, {x:g} x {y:g} x {z:g}"
        fault = solid_fault(vertices, faces)
        if fault:
            yield name, f"{text}, a picture only: {fault}"
            continue
        yield name, f"{text}, volume {polyhedron(vertices, faces).volume:.6g}"
        for finding in crossing_findings(vertices, faces):
            yield name, f"warning: {finding}"


def _said(severity: str, text: str) -> dict[str, Any]:
    """Return a message as one of the JSON object's: severity, file, line, element, message."""
    place, message = split_place(text)
    file, _, line = place.rpartition(":")
    element = _ELEMENT.match(message)
    return {
        "severity": severity,
        "file": file or None,
        "line": int(line) if line else None,
        "element": element[1] if element else None,
        "message": message[element.end() :] if element else message,
    }


class _Found(NamedTuple):
    """What is said of a deck without faults."""

    deck: Model
    counts: dict[str, int]
    elements: list[tuple[str, str]]  # element, what is said of it
    steps: list[str]  # what a run does, in order
    notes: list[str]


def _look(model: str, overrides: tuple[str, ...]) -> _Found:
    """Return what is said of a deck; raise `MbsimError` where it cannot be run."""
    from mbsim.compile_model.acting import check_expressions
    from mbsim.compile_model.advice import advice as of_laws
    from mbsim.compile_model.pairing import plan_pairs, why_costly
    from mbsim.model.names import is_adams
    from mbsim.model.subroutines import of_contacts, wanted
    from mbsim.reader.xml import read_model
    from mbsim.run.settings import settle

    deck = read_model(model, overrides)
    plans = plan_pairs(deck)
    check_expressions(deck)
    users = [*(user for *_, user in of_contacts(deck)), *(each.user for each in wanted(deck))]
    if any(user.dll_name for user in users):
        from mbsim.plugins import check_libraries

        check_libraries(deck)
    # values that a run would refuse; times may still come from the command line
    notes = settle(deck).notes if deck.simulations else ()

    from mbsim.results.log import counts, pair_texts, sequence
    from mbsim.stepping.refusals import serves_better

    said = [
        (f"Force_Contact[{id}]", text) for id in deck.contacts for text in pair_texts(plans, id)
    ]
    costly = Counter((plan.kind.contact, why_costly(deck, plan)) for plan in plans.pairs)
    said += [
        (f"Force_Contact[{id}]", f"costly, {counted(count, 'pairs')}: {why}")
        for (id, why), count in costly.items()
        if why
    ]
    said += of_laws(deck)
    said += _meshes(deck)
    said += [
        (element, "its subroutine names no file; a run needs --plugin FILE.py")
        for element in _without_file(deck)
    ]
    steps = []
    if not deck.simulations:
        more = " and --print-interval" if is_adams(deck.file) else ""
        steps.append(f"no Simulate: a run needs --end-time{more}")
    steps += sequence(deck)
    advice = [better] if (better := serves_better(deck)) else []
    return _Found(deck, counts(deck), said, steps, [*deck.notes, *notes, *advice])


def _print_text(model: str, found: _Found) -> None:
    """Print what was found for people."""
    from mbsim.results.log import units_text

    warn(found.deck.warnings)
    numbers = ", ".join(counted(count, name) for name, count in found.counts.items())
    echo(f"ok: {model}: {numbers}")
    echo(f"  units {units_text(found.deck)}")
    for element, text in found.elements:
        echo(f"  {element}: {text}")
    for line in found.steps:
        echo(f"  {line}")
    for note in found.notes:
        echo(f"  note: {note}")


def _print_json(model: str, overrides: tuple[str, ...]) -> int:
    """Print one JSON object of what was found or what is at fault; return the exit code."""
    try:
        found = _look(model, overrides)
    except MbsimError as error:
        faults = [_said("error", str(error))]
        if isinstance(error, DeckError):
            faults = [{"severity": "error", **asdict(fault)} for fault in error.faults]
        print_json({"model": model, "ok": False, "messages": faults})
        return error.exit_code
    units = found.deck.units
    print_json(
        {
            "model": model,
            "ok": True,
            "messages": [
                *(_said("warning", text) for text in found.deck.warnings),
                *(_said("note", text) for text in found.notes),
            ],
            "counts": found.counts,
            "units": {name: getattr(units, name) for name in ("force", "mass", "length", "time")},
            "elements": [{"element": name, "text": text} for name, text in found.elements],
            "steps": found.steps,
        }
    )
    return 0


@click.command("check")
@click.argument("model", type=click.Path())
@set_option("Change an attribute first")
@click.option("--repair", is_flag=True, help="Write mended copies of meshes that are no solids.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, faults included.")
@click.pass_context
def command(
    ctx: click.Context, model: str, overrides: tuple[str, ...], repair: bool, as_json: bool
) -> None:
    """Check MODEL: every fault is listed with file and line.

    Says what is in the model and how each pair of shapes will be tested. With --repair it looks
    at the meshes alone.
    """
    if repair and as_json:
        raise click.UsageError("--json is of what check finds: it does not go with --repair")
    if repair:
        _repair(model, overrides)
    elif as_json:
        ctx.exit(_print_json(model, overrides))
    else:
        _print_text(model, _look(model, overrides))
