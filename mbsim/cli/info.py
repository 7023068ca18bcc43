"""`mbsim info`: what is in a deck, in a result file or in the table of a study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mbsim.cli.messages import echo
from mbsim.cli.options import RESULT_SUFFIXES, json_option, plugin_option

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

_HDF5, _PARQUET = b"\x89HDF\r\n\x1a\n", b"PAR1"


@click.command("info")
@click.argument("file", type=click.Path(path_type=Path))
@plugin_option("File with user subroutines of a model")
@json_option("one JSON object")
def command(file: Path, plugins: tuple[Path, ...], as_json: bool) -> None:
    """Show what is in FILE, a model, a result file or the table of a study.

    Elements, forces, end state, statistics; of a table its columns and how runs ended.

    Scripts of --plugin are run, and each function of theirs is called once with iflag 1; those that
    only the deck names are not.
    """
    from mbsim.cli.messages import print_json, warn

    if _is_result(file):
        from mbsim.results.opening import read_apart
        from mbsim.results.reading import open_results

        def read() -> dict[str, Any]:
            with open_results(file) as results:
                about = _about_results(results)
                if not as_json:
                    _shorten(about, results)
            return about

        about = read_apart(read, file)
    elif _begins(file, _PARQUET):
        about = _about_table(file)
    else:
        from mbsim.reader.xml import read_model
        from mbsim.run.preparing import check_plugins

        check_plugins(plugins)
        deck = read_model(file)
        about = _about_model(deck, plugins)
        warn(deck.warnings)
    if as_json:
        print_json(about)
    else:
        _show(about)


def _is_result(file: Path) -> bool:
    """Return whether a file is HDF5, by what it holds; one that is not there, by its name."""
    return _begins(file, _HDF5) or file.suffix.lower() in RESULT_SUFFIXES


def _begins(file: Path, mark: bytes) -> bool:
    """Return whether a file begins so; one that cannot be read does not."""
    from mbsim.core.stored import read_regular

    try:
        return read_regular(file, len(mark)) == mark
    except (OSError, ValueError):
        return False


def _about_table(file: Path) -> dict[str, Any]:
    """Return how runs of a study ended, and what its numbers are."""
    import numpy as np

    from mbsim.results.form import finite
    from mbsim.studies.table import Responses

    table = Responses(file)
    ends, counts = np.unique(table["status"], return_counts=True)

    def spread(name: str) -> dict[str, Any]:
        column = table[name]
        there = column[~np.isnan(column)]
        found: dict[str, Any] = {"missing": int(len(column) - len(there))}
        if len(there):
            found |= {
                "least": float(there.min()),
                "mean": float(there.mean()),
                "most": float(there.max()),
            }
        return found

    plain: dict[str, Any] = finite(
        {
            "kind": "study",
            "file": str(file),
            "model": table.model,
            "runs": len(table),
            "status": dict(zip(ends.tolist(), counts.tolist(), strict=True)),
            "parameters": {name: spread(name) for name in table.parameters},
            "outputs": {name: spread(name) for name in table.outputs},
            "curves": ", ".join(table.curves),
        }
    )
    return plain


def _about_model(model: Model, plugins: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Return what a deck describes."""
    from mbsim.compile_model.pairing import plan_pairs
    from mbsim.model.placement import place
    from mbsim.results.form import finite
    from mbsim.results.log import counts, pair_texts, title, units_text

    placement = place(model)
    plans = plan_pairs(model)
    about = {
        "kind": "model",
        "file": model.file,
        "units": units_text(model),
        "counts": counts(model),
        "bodies": {
            str(body.id): {
                "label": model.bodies[body.id].label,
                # as in the deck; the system's mass is scaled so that F = m a
                "mass": body.mass / model.units.mass_scale,
                "position": body.p,
                "velocity": body.v,
            }
            for body in placement.bodies.values()
        },
        "contacts": {
            str(contact.id): {
                "name": title(contact),
                "normal_law": contact.cnf_type,
                "friction_law": contact.cff_type,
                "pairs": list(pair_texts(plans, contact.id)),
            }
            for contact in model.contacts.values()
        },
        **_between_markers(model),
        **_subroutines(model, plugins),
        "requests": {
            str(request.id): {"type": request.type, "label": request.label or request.comment}
            for request in model.requests.values()
        },
        "simulations": [
            {
                "analysis_type": s.analysis_type,
                "start_time": s.start_time,
                "end_time": s.end_time,
                "print_interval": s.print_interval,
                "changes": [change.text for change in s.changes],
            }
            for s in model.simulations
        ],
    }
    plain: dict[str, Any] = finite(about)
    return plain


def _subroutines(model: Model, plugins: tuple[Path, ...]) -> dict[str, Any]:
    """Return user subroutines by element: function, file, and what they ask for under iflag."""
    from mbsim.model.names import element_name, is_adams
    from mbsim.model.subroutines import asking, wanted
    from mbsim.plugins.about import about
    from mbsim.plugins.contact_post import CONTACTPOST
    from mbsim.plugins.friction import friction_arguments
    from mbsim.plugins.normal import CNFSUB, normal_arguments
    from mbsim.plugins.source.script import CFFSUB, Scripts

    scripts: Scripts = {}
    found: dict[str, Any] = {}
    for contact in model.contacts.values():
        if contact.asks_user:
            name, given = f"Force_Contact[{contact.id}]", friction_arguments(contact)
            found[f"{name} cff"] = about(contact.cff, name, "cff", CFFSUB, given, plugins, scripts)
        if contact.cnf_type == "USERCNF":
            name, given = f"Force_Contact[{contact.id}]", normal_arguments(contact)
            found[f"{name} cnf"] = about(contact.cnf, name, "cnf", CNFSUB, given, plugins, scripts)
        if contact.cpost is not None:
            name, par = f"Force_Contact[{contact.id}]", list(contact.cpost.par)
            pair = contact.i_graphics_id[0], contact.j_graphics_id[0]
            given = [contact.id, *pair, 0.0, par, len(par), 1, 0]
            found[f"{name} cpost"] = about(
                contact.cpost, name, "cpost", CONTACTPOST, given, plugins, scripts
            )
    prefix = "ROUTINE" if is_adams(model.file) else "usrsub"
    for each in wanted(model):
        name, par = element_name(model.file, each.statement, each.id), list(each.user.par)
        given = [each.id, 0.0, par, len(par), *asking(each)]
        found[name] = about(each.user, name, prefix, each.call.value, given, plugins, scripts)
    if model.force_elements:
        from mbsim.plugins.residual import about_residual

        for element in model.force_elements.values():
            name = element_name(model.file, "Force_Element", element.id)
            found[name] = about_residual(element, plugins, scripts)
    return {"subroutines": found} if found else {}


def _between_markers(model: Model) -> dict[str, Any]:
    """Return constraints and forces between markers, by group; nothing of groups without any."""
    from mbsim.results.elements import APPLIED, CONSTRAINTS, GROUPS, elements_of, equations

    about: dict[str, Any] = {}
    for statement in (*CONSTRAINTS, *APPLIED):
        for id, element in elements_of(model, statement).items():
            about.setdefault(GROUPS[statement].path, {})[str(id)] = _facts(model, element)
    if any(GROUPS[statement].path in about for statement in CONSTRAINTS):
        held = equations(model)
        moving = sum(not body.is_ground for body in model.bodies.values())
        about["degrees_of_freedom"] = {
            "of_free_bodies": 6 * moving,
            "constraint_equations": held,
            # equations may say what others say; a run finds out, and its log tells
            "at_least": max(0, 6 * moving - held),
        }
    return about


#: Attributes of an element that `info` shows, in this order.
_SHOWN = (
    *("label", "type", "joint_id", "joint_ids", "direction", "val_type", "motion_types", "scales"),
    *("pitch", "pitch_diameter", "length", "lower", "upper", "cnf_type", "stiffness", "damping"),
    *("cff_type", "mu_static", "mu_dynamic", "pin_radius", "ball_radius", "preload"),
    *("bending_reaction_arm", "action_only", "friction", "friction_static", "dx"),
)


def _facts(model: Model, element: Any) -> dict[str, Any]:
    """Return what an element says: its attributes, expression, and between what it acts."""
    from mbsim.model.names import element_name

    about = {name: getattr(element, name, None) for name in _SHOWN}
    expr = getattr(element, "expr", None)
    about["expression"] = expr.text if expr is not None else None
    for side in ("i", "j"):
        marker_id = getattr(element, f"{side}_marker_id", 0)
        if marker_id:
            body_id = model.markers[marker_id].body_id
            marker = element_name(model.file, "Reference_Marker", marker_id)
            about[side] = f"{marker} of {element_name(model.file, 'Body_Rigid', body_id)}"
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in about.items()
        if not (value is None or value is False or value in ("", ()))
    }


def _largest(results: Results) -> dict[str, Any]:
    """Return the largest force and torque of constraints and forces over rows, by group and id."""
    from mbsim.results.elements import APPLIED, CONSTRAINTS, GROUPS

    about: dict[str, Any] = {}
    for statement in (*CONSTRAINTS, *APPLIED):
        path = GROUPS[statement].path
        for id in results.ids(path):
            facts = {
                "label": results.label(f"{path}/{id}"),
                "type": results.attribute(f"{path}/{id}", "type"),
            }
            for kind in ("force", "torque"):
                rows = results[f"{path}/{id}/{kind}/mag"]
                facts[f"largest_{kind}"] = float(rows.max()) if len(rows) else None
            about.setdefault(path, {})[str(id)] = facts
    return about


def _about_results(results: Results) -> dict[str, Any]:
    """Return what a result file holds."""
    from mbsim.results.audit import facts
    from mbsim.results.form import finite
    from mbsim.results.reading import end_state

    audit = results.audit
    time, largest = results["time"], _largest(results)
    about = {
        "kind": "results",
        "file": str(results.path),
        "status": results.status,
        "attributes": results.attributes,
        "counts": {
            "rows": len(time),
            **{name: len(results.ids(name)) for name in ("bodies", "contacts")},
            **{name: len(ids) for name, ids in largest.items()},
            "requests": len(results.ids("requests")),
            "events": len(results["events"]),
        },
        "end_time": float(time[-1]) if len(time) else None,
        "bodies": end_state(results),
        "contacts": {
            str(id): {
                name: results[f"contacts/{id}/{name}"]
                for name in ("peak_force", "peak_penetration", "peak_slip_speed")
                if f"contacts/{id}/{name}" in results
            }
            for id in results.ids("contacts")
        },
        **largest,
        "audit": facts(audit) if audit is not None else {},
        "stats": results.stats,
        "signals": results.keys(),
    }
    plain: dict[str, Any] = finite(about)
    return plain


def _shorten(about: dict[str, Any], results: Results) -> None:
    """List signals as `plot` takes them, ids together, with parts and units; then the tables."""
    from mbsim.results.names import compact, parts_of
    from mbsim.results.quantities import quantity_of
    from mbsim.results.units import UnitSystem

    columns, units = results.signals(), UnitSystem.of(results.attributes)
    about["signals"] = {}
    measured: dict[str, str] = {}
    for name in columns:
        texts = (units.text(quantity_of(results, name, k)) for k in range(columns[name]))
        measured[name] = ", ".join(dict.fromkeys(filter(None, texts)))
    for short, names in compact(columns, measured).items():
        parts = " ".join(f"/{part}" for part in parts_of(columns[names[0]]))
        about["signals"][short] = f"{parts:<32} {measured[names[0]]}".rstrip() or "-"
    others = [name for name in results.keys() if name not in columns]
    about["other data"] = list(compact(others))


def _show(about: dict[str, Any]) -> None:
    """Print nested facts with indentation."""
    lines: list[str] = []

    def add(name: str, value: Any, depth: int, width: int) -> None:
        pad = "  " * depth
        if isinstance(value, dict):
            if value:
                lines.append(f"{pad}{name}")
            inner = max([26 - len(pad), *map(len, value)])
            for key, item in value.items():
                add(str(key), item, depth + 1, inner)
        elif isinstance(value, list) and value and all(isinstance(v, (int, float)) for v in value):
            numbers = " ".join(f"{v:.9g}" for v in value)
            lines.append(f"{pad}{name:<{width}} {numbers}")
        elif isinstance(value, list):
            if value:
                lines.append(f"{pad}{name}")
            for item in value:
                facts = item.items() if isinstance(item, dict) else ()
                inside = ", ".join(f"{key} {entry}" for key, entry in facts)
                lines.append(f"{pad}  {inside or item}")
        elif value not in ("", None):
            shown = f"{value:.9g}" if isinstance(value, float) else value
            lines.append(f"{pad}{name:<{width}} {shown}")

    for key, value in about.items():
        add(key, value, 0, 28)
    # in one piece: a pager that closes early breaks the pipe only once
    echo("\n".join(lines))
