"""What `mbsim identify` leaves: a JSON file, and one HTML page that needs no other file."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from mbsim import __version__
from mbsim.studies.distributions import Numbers
from mbsim.studies.identify import Identified, values_of
from mbsim.studies.judge import Judged, Parameter, RecordFit
from mbsim.studies.unknown_curves import UnknownCurve

#: Starts that a page lists.
_MOST_STARTS = 40


def facts(found: Identified) -> dict[str, Any]:
    """Return all that came of a fit, for JSON: what is not known is None."""
    problem, judged = found.problem, found.judged
    names = [unknown.name for unknown in problem.unknowns]
    about: dict[str, Any] = {
        "mbsim": __version__,
        "study": str(problem.study.file),
        "model": str(problem.study.model),
        "status": status(found),
        "runs": found.runs,
        "failed": [{"runs": count, "reason": why} for count, why in found.reasons],
        "best": problem.values(found.best.z),
        "sets": values_of(problem, found.best.z),
        "sum_of_squares": found.best.cost,
        "iterations": found.best.iterations,
        "warnings": found.warnings,
        "starts": [
            {
                "start": problem.values(fit.start),
                "end": problem.values(fit.z),
                "sum_of_squares": fit.cost,
                "ended": fit.ended,
                "reason": fit.reason,
            }
            for fit in found.fits
        ],
    }
    if judged is None:
        return _plain_table(about)
    about |= {
        "parameters": {
            p.name: {
                "estimate": p.estimate,
                "sd": p.sd,
                "interval_95": p.interval,
                "why_none": p.why,
                "low": unknown.low,
                "high": unknown.high,
                "step": judged.steps[k],
                "discrepancy": judged.discrepancy[k],
                "jacobian": judged.sources[k],
            }
            for k, (p, unknown) in enumerate(zip(judged.parameters, problem.unknowns, strict=True))
        },
        "curves": {c.name: _curve_facts(judged, c) for c in problem.unknown_curves},
        "order": names,
        "covariance": judged.covariance,
        "correlation": judged.correlation,
        "identifiability": [
            {
                "components": direction.components,
                "singular_value": direction.singular_value,
                "sd": direction.sd,
                "seen": direction.seen,
            }
            for direction in judged.directions
        ],
        "linearity": found.added,
        "misfit": vars(judged.misfit),
        "records": {
            record.name: {
                "unit": record.unit,
                "rms": record.rms,
                "correlation": record.correlation,
                "time": record.time,
                "measured": record.measured,
                "fitted": record.fitted,
                "residual": record.measured - record.fitted,
                "band_95": record.band,
            }
            for record in judged.records
        },
    }
    return _plain_table(about)


def _curve_facts(judged: Judged, curve: UnknownCurve) -> dict[str, Any]:
    """Return what is known of an unknown curve, for JSON."""
    points = judged.parameters[curve.unknowns]
    return {
        "at": curve.at,
        "value": [p.value for p in points],
        "estimate": [p.estimate for p in points],
        "sd": [p.sd for p in points],
        "interval_95": [p.interval for p in points],
    }


def _plain_table(about: dict[str, Any]) -> dict[str, Any]:
    """Return a table as `plain` has it."""
    return {key: plain(item) for key, item in about.items()}


def status(found: Identified) -> str:
    """Return how it ended: "stopped", or how the best fit did."""
    return "stopped" if found.stopped else found.best.ended


def plain(value: Any) -> Any:
    """Return a value for JSON: arrays as lists, what is not finite as None."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def lines_of(found: Identified) -> list[str]:
    """Return what came of a fit as lines for a terminal: a parameter each, then the misfit."""
    values = found.problem.values(found.best.z)
    if found.judged is None:
        return [f"{name} = {value:.6g}" for name, value in values.items()]
    alone, curves = _alone(found), found.problem.unknown_curves
    wide = max(len(name) for name in [*(p.name for p in alone), *(c.name for c in curves)])
    lines = [f"{p.name:<{wide}} = {said(p)}" for p in alone]
    for curve in curves:
        lines.append(f"{curve.name:<{wide}} = {_curve_said(found.judged, curve)}")
    return [*lines, found.judged.misfit.text]


def _alone(found: Identified) -> list[Parameter]:
    """Return the parameters that are no ordinates of unknown curves."""
    judged, curves = found.judged, found.problem.unknown_curves
    assert judged is not None
    first = min((curve.first for curve in curves), default=len(judged.parameters))
    return judged.parameters[:first]


def _curve_said(judged: Judged, curve: UnknownCurve) -> str:
    """Return what is known of an unknown curve in words."""
    points = judged.parameters[curve.unknowns]
    known = [p.sd for p in points if p.sd is not None]
    text = f"{len(points)} points from {curve.at[0]:g} to {curve.at[-1]:g}"
    if not known:
        return f"{text}, none of them seen"
    values = [p.value for p in points]
    text += f", {min(values):.4g} to {max(values):.4g}, +- {min(known):.2g} to {max(known):.2g}"
    return text if len(known) == len(points) else f"{text}; {len(points) - len(known)} not known"


def said(parameter: Parameter) -> str:
    """Return what is known of a parameter in words."""
    if parameter.sd is not None and parameter.interval is not None:
        low, high = parameter.interval
        digits = max(0, -math.floor(math.log10(parameter.sd)) + 1) if parameter.sd > 0.0 else 6
        shown = f"{parameter.value:.{min(digits, 15)}f}" if digits < 8 else f"{parameter.value:.6g}"
        return f"{shown} +- {parameter.sd:.2g}, 95 %: {low:.5g} to {high:.5g}"
    if parameter.estimate is not None:
        return f"{parameter.value:.6g}, {parameter.why}"
    return f"- ({parameter.why}: held at {parameter.value:.4g})"


def command(found: Identified) -> str:
    """Return the command line that runs the deck with the best values."""
    study = found.problem.study
    words = ["mbsim", "run", str(study.model)]
    for path, value in values_of(found.problem, found.best.z).items():
        words += ["--set", f"{path}={value}"]
    for option in ("integrator", "tol", "end_time", "print_interval"):
        if option in study.options:
            words += [f"--{option.replace('_', '-')}", str(study.options[option])]
    for plugin in study.options.get("plugins", []):
        words += ["--plugin", str(plugin)]
    return shlex.join(words)


def page(found: Identified) -> str:
    """Return the report of a fit as one HTML page."""
    from mbsim.view.page import static
    from mbsim.view.report import paged

    problem, judged, name = found.problem, found.judged, found.problem.name
    sections = [("Summary", _summary(found)), ("Warnings", _warnings(found))]
    if judged is not None:
        sections += [
            ("Parameters", _parameters(_alone(found)) + _correlation(judged, len(_alone(found)))),
            ("Curves", "".join(_curve(judged, each) for each in problem.unknown_curves)),
            ("Records", "".join(_record(record) for record in judged.records)),
            ("Misfit", _misfit(judged)),
            ("Identifiability", _identifiability(found, judged)),
            ("Jacobian", _jacobian(judged)),
        ]
    sections += [
        ("Starts", _starts(found)),
        ("Run with these values", f"<pre><code>{escape(command(found))}</code></pre>"),
        ("Study file", f"<pre><code>{escape(_text(found.problem.study.file))}</code></pre>"),
    ]
    return paged(f"{name}: identification", name, sections, static("report.css"))


def _text(file: Path) -> str:
    """Return the text of the study file, or why there is none."""
    try:
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        return f"{file} cannot be read any more: {error.strerror}"


def _summary(found: Identified) -> str:
    """Return what was fitted, and how that ended."""
    from mbsim.view.report_parts import facts as table_of

    problem, judged = found.problem, found.judged
    return table_of(
        {
            "model": str(problem.study.model),
            "fit": status(found),
            "misfit": judged.misfit.text if judged else "",
            "iterations": found.best.iterations,
            "starts": len(found.fits),
            "runs": found.runs,
            "failed runs": "; ".join(f"{count}: {why}" for count, why in found.reasons),
            "rows of records": len(problem.measured),
            "mbsim": __version__,
        }
    )


def _warnings(found: Identified) -> str:
    """Return what must not be overlooked."""
    if not found.warnings:
        return '<p class="good">None.</p>'
    lines = (f'<li class="warning">{escape(line)}</li>' for line in found.warnings)
    return f"<ul>{''.join(lines)}</ul>"


def _parameters(parameters: Sequence[Parameter]) -> str:
    """Return the table of parameters."""
    from mbsim.view.report_parts import table

    rows: list[list[Any]] = []
    for p in parameters:
        low, high = p.interval or (math.nan, math.nan)
        shown: list[Any] = ["-" if p.estimate is None else p.estimate, p.sd or "-"]
        ends = [low, high] if p.interval else ["-", "-"]
        note = f"{p.why}: held at {p.value:.4g}" if p.why and p.estimate is None else p.why
        rows.append([p.name, *shown, *ends, note])
    return table(("parameter", "estimate", "sd", "95 % from", "to", ""), rows)


def _correlation(judged: Judged, count: int) -> str:
    """Return the table of correlations between those of the first parameters that are known."""
    from mbsim.view.report_parts import table

    known = [k for k, p in enumerate(judged.parameters[:count]) if p.sd is not None]
    if len(known) < 2:
        return ""
    names = [judged.parameters[k].name for k in known]
    rows = [
        [name, *(f"{judged.correlation[k, other]:.3f}" for other in known)]
        for name, k in zip(names, known, strict=True)
    ]
    return f"<h3>Correlation</h3>{table(('', *names), rows)}"


def _curve(judged: Judged, curve: UnknownCurve) -> str:
    """Return an unknown curve with its band; points that are not known have none."""
    from mbsim.view.plot_svg import Curve, drawn

    points = judged.parameters[curve.unknowns]
    values = np.array([p.value for p in points])
    band = np.array([0.5 * (p.interval[1] - p.interval[0]) if p.interval else 0.0 for p in points])
    shown = drawn(
        [Curve("estimate, with 95 % band", curve.at, values, band)], curve.name, "Abscissa"
    )
    note = _curve_said(judged, curve)
    return (
        f'<figure><h3>{escape(curve.name)}</h3>{shown}</figure><p class="note">{escape(note)}</p>'
    )


def _record(record: RecordFit) -> str:
    """Return the curves of a record, measured and fitted, and of what is left."""
    from mbsim.view.plot_svg import Curve, drawn

    axis = f"{record.name} [{record.unit}]" if record.unit else record.name
    curves = [
        Curve("measured", record.time, record.measured),
        Curve("fitted, with 95 % band", record.time, record.fitted, record.band),
    ]
    left = [Curve("measured - fitted", record.time, record.measured - record.fitted)]
    if record.sd is not None:
        noise: Numbers = 2.0 * record.sd
        left.append(Curve("two standard deviations of the noise", record.time, 0.0 * noise, noise))
    at, off = record.worst
    note = (
        f"rms {record.rms:.4g} {record.unit}, largest {off:.4g} at time {at:.6g}; correlation "
        f"from row to row {record.correlation:.3f}"
    )
    return (
        f"<figure><h3>{escape(record.name)}</h3>{drawn(curves, axis, 'Time of the record')}"
        f'</figure><figure>{drawn(left, axis, "Time of the record")}</figure><p class="note">'
        f"{escape(note)}</p>"
    )


def _misfit(judged: Judged) -> str:
    """Return whether the model explains the records."""
    from mbsim.view.report_parts import facts as table_of

    misfit = judged.misfit
    kind = "good" if misfit.explained else "warning"
    said_so = f'<p class="{kind}"><strong>{escape(misfit.text)}</strong></p>'
    return said_so + table_of(
        {
            "chi-square": misfit.chi_square,
            "degrees of freedom": misfit.degrees_of_freedom,
            "probability": misfit.probability,
            "s": misfit.s,
        }
    )


def _identifiability(found: Identified, judged: Judged) -> str:
    """Return the combinations of parameters, from the best seen on."""
    from mbsim.view.report_parts import table

    added = iter(found.added)
    rows = [
        [
            direction.text,
            direction.singular_value,
            f"{direction.sd:.3g}" if math.isfinite(direction.sd) else "unbound",
            "yes" if direction.seen else "no",
            f"{next(added, math.nan):.2f}" if direction.seen else "-",
        ]
        for direction in judged.directions
    ]
    head = ("combination, in parts of the ranges", "singular value", "sd", "seen", "sd adds")
    note = (
        "Singular values are those of the Jacobian of the residuals, in standard deviations of the "
        "noise, over the ranges of the parameters. A combination that is less certain than the "
        "range is wide (sd above 0.29) is not seen. A standard deviation along it adds 1 to the "
        "sum of squares where curves are linear."
    )
    return table(head, rows) + f'<p class="note">{escape(note)}</p>'


def _jacobian(judged: Judged) -> str:
    """Return what the columns are from, and their check."""
    from mbsim.view.report_parts import table

    rows = [
        [p.name, judged.steps[k], f"{judged.discrepancy[k]:.2g}", judged.sources[k]]
        for k, p in enumerate(judged.parameters)
    ]
    head = ("parameter", "step, part of the range", "two steps differ by", "column from")
    return table(head, rows)


def _starts(found: Identified) -> str:
    """Return where fits began and ended, the best first."""
    from mbsim.view.report_parts import table

    fits = sorted(found.fits, key=lambda fit: fit.cost)
    problem = found.problem
    names = [unknown.name for unknown in problem.unknowns]
    rows = [
        [
            *(f"{value:.5g}" for value in problem.values(fit.start).values()),
            *(f"{value:.5g}" for value in problem.values(fit.z).values()),
            fit.cost,
            fit.ended + (f": {fit.reason}" if fit.reason else ""),
        ]
        for fit in fits[:_MOST_STARTS]
    ]
    return table((*(f"{n} from" for n in names), *names, "sum of squares", "ended"), rows)
