"""Decks of a few seconds, of every method and kind of state, for runs that are killed.

Each entry of `CASES` takes a folder for what it writes and returns a deck and options of its run.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, sphere
from helpers.folders import CORPUS, MODELS, USERFUNCS
from helpers.libraries import example
from helpers.pile_decks import block, pile, shape_graphic, solid

Case = tuple[str, list[str]]

#: An interpreted law with states of its own.
STATES = """
CFFSUB_STATES = 2
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag, state):
    pull = [-2e3 * x[0] - state[0], -2e3 * x[1] - state[1]]
    return [pull[0], pull[1], 0.0], [0.9 * state[0] + xdot[0], 0.9 * state[1] + xdot[1]]
"""
#: Where a ball is, and how fast: columns of the .csv.
REQUESTS = (
    '<Post_Request id="1" type="MARKER_DISPLACEMENT" i_marker_id="20"/>'
    '<Post_Request id="2" type="MARKER_VELOCITY" i_marker_id="20"/>'
)
USER = {"cff_type": "USERCFF", "cff_fnc_name": "CFFSUB"}
#: The law of meshes with elastic layers, without a stiffness.
VOLUME = {
    **{"cnf_type": "VOLUME", "damping": 0.5},
    **{"i_elastic_modulus": 1e7, "i_poisson_ratio": 0.3, "i_layer_depth": 0.02},
}


def transient(end: float, interval: float) -> str:
    """Return a Simulate."""
    times = f'end_time="{end!r}" print_interval="{interval!r}"'
    return f'<Simulate analysis_type="Transient" {times}/>'


def written(folder: Path, model: str, commands: str) -> str:
    """Write a deck with the requests and return its path."""
    path = folder / "deck.xml"
    text = f"<Model>{model}{REQUESTS}</Model><Command>{commands}</Command>"
    path.write_text(f"<MotionSolve>{text}</MotionSolve>", encoding="utf-8")
    return str(path)


def of_models(name: str, *options: str) -> Callable[[Path], Case]:
    """Return the case of a deck of models/."""
    return lambda folder: (str(MODELS / f"{name}.xml"), list(options))


def of_corpus(name: str, end: str) -> Callable[[Path], Case]:
    """Return the case of a deck of tests/corpus/, with many rows."""
    deck = str(CORPUS / name)
    return lambda folder: (deck, ["--end-time", end, "--print-interval", "0.001"])


def sliding(folder: Path, law: dict[str, str], end: float, *options: str) -> Case:
    """Return a ball that slides and rolls with a user's friction."""
    text = GROUND + sphere(0.0995, v=(0.5, 0.1, 0)) + contact(**USER, **law) + GRAVITY
    return written(folder, text, transient(end, 0.001)), list(options)


def states_interpreted(folder: Path) -> Case:
    """Return a law that keeps numbers of its own, interpreted."""
    (folder / "law.py").write_text(STATES, encoding="utf-8")
    return sliding(folder, {"script_name": "law.py"}, 4.0, "--interpret-plugins")


def states_compiled(folder: Path) -> Case:
    """Return a law that keeps numbers of its own, compiled."""
    shutil.copy(USERFUNCS / "stiction_with_state.py", folder)
    law = {"script_name": "stiction_with_state.py", "cff_param_string": "USER(0.4, 2e4, 3)"}
    return sliding(folder, law, 60.0, "--tol", "1e-9")


def library(folder: Path) -> Case:
    """Return a law in C."""
    example(folder, "cffsub.c")
    law = {"cff_dll_name": "cffsub_c.so", "cff_param_string": "USER(0.3, 0.2, 0.01, 0.02)"}
    return sliding(folder, law, 20.0, "--integrator", "DOP853", "--tol", "1e-11")


def stages(folder: Path) -> Case:
    """Return many Simulates: rest, other gravity, another spring, many ends to be killed at."""
    spring = (
        '<Reference_Marker id="11" body_id="1" pos_z="1"/><Force_SpringDamper id="7" '
        'type="TRANSLATIONAL" i_marker_id="20" j_marker_id="11" stiffness="{}" damping="0.1" '
        'length="0.5"/>'
    )
    model = GROUND + sphere(0.4) + contact(**COULOMB) + GRAVITY + spring.format(30)
    commands = '<Simulate analysis_type="Static"/>'
    for k in range(1, 41):
        commands += f'<Force_Gravity grav_x="{(-1) ** k * 3}" grav_z="{-9.81 - k % 3}"/>'
        if k % 4 == 0:
            commands += f'<Force_SpringDamper id="7" stiffness="{30 + k}"/>'
        commands += transient(0.8 * k, 0.004)
        if k == 20:
            commands += '<Simulate analysis_type="Static"/>'
    return written(folder, model, commands), ["--tol", "1e-10"]


def sensors(folder: Path) -> Case:
    """Return a bouncing ball whose sensors change rows, steps, a force, and end a Simulate."""
    watch = "".join(
        f'<Sensor_Event id="{id}" type="EXPRESSION" expr="{expr}" compare="{compare}" '
        f'value="{value!r}" {what}/>'
        for id, expr, compare, value, what in (
            (1, "DZ(20)", "LE", 0.12, 'zero_crossing="TRUE" print="TRUE" evaluate="TIME"'),
            (2, "SIN(7*TIME)", "EQ", 0.0, 'zero_crossing="TRUE" evaluate="SENVAL(2)+1"'),
            (3, "TIME", "GE", 5.0, 'zero_crossing="TRUE" dt="0.0007" hmax="0.002"'),
            (4, "TIME", "GE", 10.0, 'zero_crossing="TRUE" dt="0.002" stepsize="1e-5"'),
            (5, "TIME", "GE", 20.0, 'zero_crossing="TRUE" return_="TRUE"'),
            (6, "TIME", "GE", 40.0, 'zero_crossing="FALSE" halt="TRUE"'),
        )
    ).replace("return_", "return")
    push = (
        '<Reference_Marker id="12" body_id="1"/><Force_Scalar_TwoBody id="1" '
        'type="TRANSLATIONAL" i_marker_id="20" j_marker_id="12" expr="0.1*SIN(SENVAL(2))"/>'
    )
    shown = '<Post_Request id="3" type="EXPRESSION" expr2="SENVAL(1)" expr3="SENVAL(2)"/>'
    model = GROUND + sphere(0.5) + contact() + GRAVITY + watch + push + shown
    both = transient(25.0, 0.002) + transient(90.0, 0.004)
    return written(folder, model, both), ["--tol", "1e-9"]


def broadphase(folder: Path, method: str, end: float, interval: float = 0.002) -> Case:
    """Return a pile of 64 balls, whose near pairs are looked for, as it falls apart."""
    places = block(4, 0.201, z=0.101, jitter=0.02, seed=3)
    text = pile(places, stiffness=1e5, exponent=1.5, damping=100.0, dmax=1e-4, **COULOMB)
    return written(folder, text + GRAVITY, transient(end, interval)), ["--integrator", method]


def meshes(folder: Path, end: float = 25.0, **law: object) -> Case:
    """Return meshes that fall on a plane and tumble."""
    random = np.random.default_rng(5)
    text = GROUND
    for body in range(2, 6):
        place = (0.5 * body, 0.0, 0.3)
        text += solid(
            body, partial(shape_graphic, "MESH", size=0.1), place, v=random.normal(size=3)
        )
        text += contact(i=100 * body, j=100, id=300 + body, **{**COULOMB, **law})
    return written(folder, text + GRAVITY, transient(end, 0.005)), ["--tol", "1e-7"]


def some_signals(folder: Path) -> Case:
    """Return a run of which few signals are recorded."""
    deck, options = broadphase(folder, "VERLET", 1.5)
    return deck, [*options, "--signals", "bodies/*/position", "--signals", "contacts"]


CASES: dict[str, Callable[[Path], Case]] = {
    "bowling ball, a compiled plugin": of_models(
        "bowling_ball", "--tol", "1e-11", "--end-time", "120"
    ),
    "bowling ball, interpreted": of_models(
        "bowling_ball", "--interpret-plugins", "--end-time", "60"
    ),
    "weakening, memory of a plugin": of_models("belt_weakening", "--tol", "1e-9"),
    "LuGre": of_models("lugre_stick_slip", "--integrator", "RADAU5", "--end-time", "400"),
    "LuGre, explicit": of_models("lugre_stick_slip", "--integrator", "DOP853", "--end-time", "12"),
    "SDND121": of_models("sdnd121", "--tol", "1e-9", "--end-time", "12"),
    "Force_Element": of_models("dry_friction_element", "--tol", "1e-10", "--end-time", "0.3"),
    "cam, AUTO": of_models("cam", "--tol", "1e-8", "--end-time", "2"),
    "stop, GALPHA": of_models(
        "four_bar_stop", "--integrator", "GALPHA", "--tol", "1e-7", "--end-time", "2"
    ),
    "governor": of_models("flyball_governor", "--print-interval", "0.004", "--end-time", "50"),
    "rigid stiction": of_models("stiction_rigid", "--end-time", "20"),
    "disc": of_models(
        "contensou_disc", "--integrator", "DOPRI5", "--tol", "1e-9", "--end-time", "5"
    ),
    "walls": of_models("poisson_walls", "--tol", "1e-10", "--end-time", "150"),
    "stack, RADAU5": of_models("stiff/box_stack", "--integrator", "RADAU5", "--end-time", "8"),
    "bushings, GALPHA": of_models(
        "stiff/bushing_chain", "--integrator", "GALPHA", "--end-time", "3"
    ),
    "states, interpreted": states_interpreted,
    "states, compiled": states_compiled,
    "a law in C, DOP853": library,
    "many Simulates": stages,
    "sensors": sensors,
    "broadphase": partial(broadphase, method="AUTO", end=0.2),
    "broadphase, VERLET": partial(broadphase, method="VERLET", end=1.5),
    # rows of many blocks, which are written beside the loop
    "broadphase, many rows": partial(broadphase, method="VERLET", end=0.8, interval=0.0004),
    "meshes": meshes,
    "meshes, FIELD": partial(meshes, end=4.0, contact_depth="FIELD"),
    "meshes, VOLUME": partial(meshes, end=4.0, **VOLUME),
    "bolt and plate": of_models("bolt_on_plate", "--end-time", "0.02"),
    "balls in a bowl": of_models("balls_in_bowl", "--end-time", "0.6"),
    "ratchet": of_models("ratchet", "--end-time", "0.3", "--print-interval", "0.001"),
    "cam from a mesh": of_models("cam_from_stl"),
    "gear pair": of_models("gear_pair", "--end-time", "0.004", "--print-interval", "0.0001"),
    "mixed pile": of_models("mixed_pile", "--end-time", "0.03", "--print-interval", "0.0005"),
    "some signals": some_signals,
    "walls, MOREAU": of_models("poisson_walls", "--integrator", "MOREAU", "--end-time", "3000"),
    "stack, MOREAU": of_models(
        "stiff/box_stack", "--integrator", "MOREAU", "--end-time", "8", "--print-interval", "0.0005"
    ),
    "Adams, gears": of_corpus("adams_gear.acf", "10"),
    "Adams, contact": of_corpus("adams_contact.adm", "20"),
    "Force_Field": of_corpus("force_field.xml", "100"),
    "Force_MultiPoint": of_corpus("force_multipoint.xml", "100"),
    "GSE, states of a subroutine": of_corpus("gse.xml", "40"),
    "coupler by a subroutine": of_corpus("coupler_user.xml", "20"),
}
