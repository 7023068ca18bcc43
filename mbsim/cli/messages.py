"""What the subcommands say to people: always on standard error."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import click


def warn(lines: Iterable[str]) -> None:
    """Print warnings."""
    for line in lines:
        click.echo(f"mbsim: warning: {line}", err=True)


def print_json(value: Mapping[str, Any]) -> None:
    """Print the one JSON object that standard output shall hold."""
    click.echo(json.dumps(value, allow_nan=False))
