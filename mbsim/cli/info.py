"""`mbsim info`: what is in a model or a result file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click


def _of_model(path: Path) -> dict[str, Any]:
    """Return what a deck holds."""
    from mbsim.model.placement import place
    from mbsim.reader.xml import read_model

    deck = read_model(path)
    where = place(deck)
    units = deck.units
    return {
        "file": str(path),
        "units": f"{units.force} {units.mass} {units.length} {units.time}",
        "moving_bodies": len(where.bodies),
        "markers": len(deck.markers),
        "graphics": len(deck.graphics),
        "contacts": len(deck.contacts),
        "requests": len(deck.requests),
        "end_time": deck.simulations[-1].end_time if deck.simulations else None,
        "size": where.L,
        "bodies": {
            str(id): {"label": deck.bodies[id].label, "mass": body.mass / units.mass_scale}
            for id, body in where.bodies.items()
        },
        "warnings": list(deck.warnings),
        "notes": list(deck.notes),
    }


def _of_results(path: Path) -> dict[str, Any]:
    """Return what a result file holds."""
    from mbsim.results.reading import end_state, open_results

    with open_results(path) as results:
        time = results["time"] if "time" in results else []
        return {
            "file": str(path),
            **results.attributes,
            "rows": len(time),
            "last_time": float(time[-1]) if len(time) else None,
            "stats": results.stats,
            "signals": results.keys(),
            "bodies": end_state(results),
        }


def _print(values: dict[str, Any], indent: int = 0) -> None:
    """Print nested facts, one a line."""
    for name, value in values.items():
        if isinstance(value, dict):
            click.echo(" " * indent + f"{name}:")
            _print(value, indent + 2)
        elif isinstance(value, list) and value and isinstance(value[0], str):
            click.echo(" " * indent + f"{name}:")
            for item in value:
                click.echo(" " * (indent + 2) + item)
        elif isinstance(value, list):
            click.echo(" " * indent + f"{name}: " + " ".join(f"{item:.9g}" for item in value))
        else:
            shown = f"{value:.9g}" if isinstance(value, float) else value
            click.echo(" " * indent + f"{name}: {shown}")


@click.command("info")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")
def command(file: Path, as_json: bool) -> None:
    """Say what is in MODEL.xml or RESULT.h5."""
    values = _of_results(file) if file.suffix.lower() in (".h5", ".hdf5") else _of_model(file)
    if as_json:
        from mbsim.results.reading import finite

        click.echo(json.dumps(finite(values)))
    else:
        _print(values)
