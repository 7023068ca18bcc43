"""The table that `mbsim run --profile` prints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbsim.cli.messages import echo
from mbsim.core.profile import LOOP_PARTS, PARTS

_ABOUT = {
    "import": "modules of Python, its start included",
    "compile": "functions that no cache holds",
    "load": "compiled functions",
    "read": "the deck",
    "build": "arrays of the model",
    "start": "assembly, first contacts",
    "loop": "steps, of it:",
    "storing": "rows and files",
    "rest": "all else",
    "detect": "pairs: closed forms, FCL, lists of what is near",
    "contacts": "points of contact and their sums",
    "forces": "laws, forces between markers, expressions",
    "joints": "joints, equations, friction by reactions",
    "linear_algebra": "derivatives, factors, solutions",
    "evaluation": "positions, velocities, accelerations",
    "step_control": "errors, guards, events, commits",
    "rows": "output rows",
    "method": "the method's own, between these",
}


def print_profile(stats: Mapping[str, Any]) -> None:
    """Print the parts of a run that took time, and how often parts of the loop were called."""
    total = sum(stats[f"profile_{name}_s"] for name in PARTS)
    echo(f"{'part':<18}{'seconds':>10}{'share':>8}{'calls':>12}")

    def line(name: str, key: str, indent: str = "") -> None:
        seconds, calls = stats.get(f"profile_{key}_s", 0.0), stats.get(f"profile_{key}_calls")
        if seconds == 0.0:
            return
        called = "" if calls is None else str(calls)
        label = indent + name.replace("_", " ")
        share = f"{100.0 * seconds / total:.1f} %"
        echo(f"{label:<18}{seconds:>10.4f}{share:>8}{called:>12}  {_ABOUT[name]}")

    for name in PARTS:
        line(name, name)
        if name == "loop":
            for part in (*LOOP_PARTS, "method"):
                line(part, f"loop_{part}", "  ")
    echo(f"{'in all':<18}{total:>10.4f}")
