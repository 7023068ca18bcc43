"""What an expression costs against the same law written in C and called by its address.

    python -m pytest -q -m bench -s tests/bench/test_expression_cost.py

Both sides measure the markers: the C code does it from the same arrays of bodies and markers.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import time

import numpy as np
import pytest

from helpers import free_bodies as free
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.core.address import call_float, pack, view
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.expressions.jets import value
from mbsim.dynamics.pipeline.force_hooks import open_expressions
from mbsim.expressions.parse import parse
from mbsim.model.elements import Marker, Request, Spline

pytestmark = pytest.mark.bench

CALLS = 300_000
MOST = 3.0

MEASURES = r"""
#include <math.h>
typedef struct { double x, y, z; } V;
typedef const double *D;
#define ARGS double t, D y, D R, D v, D w, D mp, D mR, const long *mb
#define ALL t, y, R, v, w, mp, mR, mb
static V rot(D a, V u) { V r = { a[0]*u.x + a[1]*u.y + a[2]*u.z, a[3]*u.x + a[4]*u.y + a[5]*u.z,
                                 a[6]*u.x + a[7]*u.y + a[8]*u.z }; return r; }
static V sub(V a, V b) { V r = { a.x - b.x, a.y - b.y, a.z - b.z }; return r; }
static V add(V a, V b) { V r = { a.x + b.x, a.y + b.y, a.z + b.z }; return r; }
static V cross(V a, V b) { V r = { a.y*b.z - a.z*b.y, a.z*b.x - a.x*b.z, a.x*b.y - a.y*b.x };
                           return r; }
static double dot(V a, V b) { return a.x*b.x + a.y*b.y + a.z*b.z; }
static V at(D p) { V r = { p[0], p[1], p[2] }; return r; }
static V arm(ARGS, int m) { return rot(R + 9*mb[m], at(mp + 3*m)); }
static V point(ARGS, int m) {
    V o = { 0, 0, 0 };
    return add(mb[m] < 2 ? at(y + 13*mb[m]) : o, arm(ALL, m));
}
static V axis(ARGS, int m, int k) {
    D a = mR + 9*m; V e = { a[k], a[3 + k], a[6 + k] };
    return rot(R + 9*mb[m], e);
}
static V speed(ARGS, int m) {
    return add(at(v + 3*mb[m]), cross(at(w + 3*mb[m]), arm(ALL, m)));
}
static double DXYZ(ARGS, int i, int j, int k, int a) {
    return dot(sub(point(ALL, i), point(ALL, j)), axis(ALL, k, a));
}
static double DM(ARGS, int i, int j) {
    V r = sub(point(ALL, i), point(ALL, j)); return sqrt(dot(r, r));
}
static double VXYZ(ARGS, int i, int j, int k, int l, int a) {
    V r = sub(point(ALL, i), point(ALL, j));
    V u = sub(sub(speed(ALL, i), speed(ALL, j)), cross(at(w + 3*mb[l]), r));
    return dot(u, axis(ALL, k, a));
}
static double step(double x, double x0, double h0, double x1, double h1) {
    if (x <= x0) return h0;
    if (x >= x1) return h1;
    double s = (x - x0) / (x1 - x0);
    return h0 + (h1 - h0) * s*s*(3 - 2*s);
}
static double impact(double x, double rate, double x1, double k, double e, double c, double d) {
    if (x >= x1) return 0;
    double f = k*pow(x1 - x, e) - step(x1 - x, 0, 0, d, c)*rate;
    return f > 0 ? f : 0;
}
"""

SPLINE_X = tuple(0.1 * k for k in range(-30, 31))
SPLINE_Y = tuple(float(np.tanh(x) + 0.1 * x**3) for x in SPLINE_X)

#: Name, expression, and the body of the C function; I, J, G are rows of markers.
LAWS = [
    (
        "spring and damper",
        "-1000*DX(21,11) - 10*VX(21,11)",
        "return -1000*DXYZ(ALL, I, J, G, 0) - 10*VXYZ(ALL, I, J, G, G, 0);",
    ),
    (
        "impact, switched on",
        "STEP(TIME, 0, 0, 1, 1)*IMPACT(DZ(21,11), VZ(21,11), 9, 1e5, 2.2, 100, 0.01)",
        "return step(t, 0, 0, 1, 1)"
        "*impact(DXYZ(ALL, I, J, G, 2), VXYZ(ALL, I, J, G, G, 2), 9, 1e5, 2.2, 100, 0.01);",
    ),
    (
        "spline",
        "-AKISPL(DX(21,11), 0, 1) - 5*VX(21,11)",
        "return -curve(DXYZ(ALL, I, J, G, 0)) - 5*VXYZ(ALL, I, J, G, G, 0);",
    ),
    (
        "functions",
        "100*SIN(3*TIME)*EXP(-0.1*DM(21,11)) + 20*(1 + DY(21,11)**2)**1.5*COS(TIME)",
        "double dy = DXYZ(ALL, I, J, G, 1);"
        "return 100*sin(3*t)*exp(-0.1*DM(ALL, I, J)) + 20*pow(1 + dy*dy, 1.5)*cos(t);",
    ),
    ("numbers and TIME", "10*SIN(6.28*TIME) + 3*TIME", "return 10*sin(6.28*t) + 3*t;"),
]


def spline_in_c(scene) -> str:
    """Return the pieces of the one spline and a search by halves, in C."""
    rows = ",".join(
        "{" + ",".join(map(repr, map(float, row))) + "}" for row in scene.programs.piece
    )
    return (
        f"static const double P[{len(scene.programs.piece)}][5] = {{{rows}}};"
        "static double curve(double x) { int a = 0, b = sizeof P / sizeof P[0] - 1;"
        " if (x <= P[b][0]) b--;"
        " while (a < b) { int m = (a + b + 1)/2; if (P[m][0] <= x) a = m; else b = m - 1; }"
        " double s = x - P[a][0]; return P[a][1] + s*(P[a][2] + s*(P[a][3] + s*P[a][4])); }\n"
    )


def _expressions(context, program, y, calls):
    scene = view(context, Scene)
    total = 0.0
    for k in range(calls):
        total += value(scene, 1e-6 * k, y, program)
    return total


def _compiled_c(address, context, y, calls):
    scene = view(context, Scene)
    work, markers = scene.work, scene.markers
    total = 0.0
    for k in range(calls):
        given = (1e-6 * k, y, work.R, work.v, work.w, markers.p, markers.R, markers.body)
        total += call_float(address, given)
    return total


def best(run) -> float:
    """Return the least time of several runs, per call [s]."""
    run()
    times = []
    for _ in range(7):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return min(times) / CALLS


def test_expressions_against_c(tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("needs gcc, to compile the laws it compares with")
    rng = np.random.default_rng(1)
    model = free.model(
        free.body(2, p=(0.3, 0.2, 0.5), v=(1, 2, 3), w=(0.3, 0.2, 0.1)),
        free.body(3),
        markers=[
            Marker(11, body_id=1, pos=(0.1, 0.2, 0.3), R=free.rotation((1, 2, 3), 0.4)),
            Marker(21, body_id=2, pos=tuple(rng.normal(size=3)), R=free.rotation((3, 2, 1), 1.0)),
        ],
        requests=[Request(1, "EXPRESSION", exprs=tuple(parse(text) for _, text, _ in LAWS))],
        splines=[Spline(1, SPLINE_X, (SPLINE_Y,))],
    )
    system = build(model)
    scene = system.scene
    open_expressions(scene)
    place_bodies(scene, system.y0)
    rows = {"I": system.marker_rows[21], "J": system.marker_rows[11], "G": 0}
    source = MEASURES + spline_in_c(scene)
    source += "".join(f"enum {{ {name}_ROW = {row} }};\n" for name, row in rows.items())
    source += "#define I I_ROW\n#define J J_ROW\n#define G G_ROW\n"
    source += "".join(f"double law{k}(ARGS) {{ {body} }}\n" for k, (_, _, body) in enumerate(LAWS))
    (tmp_path / "laws.c").write_text(source)
    built = ["gcc", "-O2", "-shared", "-fPIC", "-o", "laws.so", "laws.c", "-lm"]
    subprocess.run(built, cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "laws.so"))
    table = pack(scene)
    context = int(table.ctypes.data)
    expressions, in_c = jit.function(_expressions), jit.function(_compiled_c)
    print("\nlaw                      mbsim [ns]    C [ns]   ratio")
    ratios = []
    for k, (name, _, _) in enumerate(LAWS):
        address = ctypes.cast(getattr(library, f"law{k}"), ctypes.c_void_p).value
        assert expressions(context, k, system.y0, 1000) == pytest.approx(
            in_c(address, context, system.y0, 1000), rel=1e-12
        )
        ours = best(lambda k=k: expressions(context, k, system.y0, CALLS))
        theirs = best(lambda address=address: in_c(address, context, system.y0, CALLS))
        ratios.append(ours / theirs)
        print(f"{name:24} {1e9 * ours:10.1f} {1e9 * theirs:9.1f} {ours / theirs:7.2f}")
    # the last law measures nothing: its ratio is that of the interpreter alone, and only shown
    assert max(ratios[:-1]) < MOST
