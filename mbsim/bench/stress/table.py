"""What the cases came to: a table by family, and every fault by its name."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from mbsim.bench import report
from mbsim.bench.stress.judge import ENDED, FAULTS, REFUSED, RIGHT, TOLD, Verdict
from mbsim.errors import ResultsError


def write_csv(path: Path, machine: Mapping[str, str], verdicts: Sequence[Verdict]) -> None:
    """Write one line a case."""
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([*Verdict._fields, *machine])
            writer.writerows([*entry, *machine.values()] for entry in verdicts)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def markdown(verdicts: Sequence[Verdict]) -> str:
    """Return the table by family, and lists of faults and of runs that ended early."""
    ends = (RIGHT, TOLD, ENDED, REFUSED, *FAULTS)
    lines = []
    for family in dict.fromkeys(entry.family for entry in verdicts):
        own = [entry for entry in verdicts if entry.family == family]
        count = Counter(entry.ended for entry in own)
        worst = max((entry.worst for entry in own if entry.ended == RIGHT), default=0.0)
        seconds = max(entry.seconds for entry in own)
        lines.append(
            [
                *(family, str(len(own))),
                *(str(count[end]) if count[end] else "" for end in ends),
                *(f"{worst:.2g}", f"{seconds:.1f}"),
            ]
        )
    total = Counter(entry.ended for entry in verdicts)
    lines.append(["all", str(len(verdicts)), *(str(total[end]) for end in ends), "", ""])
    header = ["family", "cases", *ends, "worst over allowed", "longest [s]"]
    parts = ["# Stability under stress", report.table(header, lines)]
    for end, title in ((None, "Faults"), (ENDED, "Ended early, with a reason"), (TOLD, "Told")):
        found = [
            entry
            for entry in verdicts
            if (entry.ended in FAULTS if end is None else entry.ended == end)
        ]
        if found:
            parts += [f"## {title}", "\n".join(map(line, found))]
    return "\n\n".join(parts) + "\n"


def line(entry: Verdict) -> str:
    """Return a verdict as one line."""
    name = f"{entry.family}, {entry.deck}, {entry.integrator} {entry.tol:g}"
    return f"- {name}: {entry.ended}" + (f": {entry.reason}" if entry.reason else "")
