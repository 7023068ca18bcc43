"""User subroutines: what is compiled, that it does what Python does, and what a failure says."""

import ctypes
import math
import os
import py_compile
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mbsim.plugins as plugins
from helpers.folders import PACKAGES, ROOT
from mbsim.core.codes import Code
from mbsim.errors import ModelError, PluginError
from mbsim.laws.catalog import FRICTION_LAWS, FrictionInput
from mbsim.model.elements import Contact, Subroutine
from mbsim.plugins import helpers

PAR = (0.05, 0.01, 0.1, 0.5)
ARGS = "id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag"
INPUTS = [0.7, 0.0, 0.01, -0.02, 0.03, 0.3, -0.4, 0.2, 0, 0, 5.0, 0, 0, 1, 2, 3, 4, 5, 6]
INPUTS += 5 * [0.0]  # what only derivatives and laws with memory are told
C_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p
)


def contact(par=PAR, **words):
    words = {"fnc_name": "CFFSUB", "dll_name": "NULL", **words}
    return Contact(id=301001, cff_type="USERCFF", cff=Subroutine(par=par, **words))


def call(user, inputs=INPUTS):
    given, out = (ctypes.c_double * len(INPUTS))(*inputs), (ctypes.c_double * 5)(*[math.nan] * 5)
    code = C_FUNCTION(user.address)(301001, given, user.par.ctypes.data, out)
    return code, list(out)


@pytest.fixture
def load(tmp_path):
    """Return a function that loads a script, or the body of a CFFSUB, and keeps the log."""
    log = []

    def loader(text, interpret=False, par=PAR, **words):
        if "def " not in text:
            text = f"def CFFSUB({ARGS}):\n" + "".join(f"    {x}\n" for x in text.split("\n"))
        file = tmp_path / "script.py"
        file.write_text(text, encoding="utf-8")
        return plugins.load_friction(contact(par, **words), [file], interpret, log=log.append)

    loader.log = log
    yield loader
    plugins.failure.clear()


# -- the shipped examples


@pytest.fixture(scope="module", params=["coulomb_stribeck", "seed_cffsub"])
def shipped(request):
    return plugins.load_friction(contact(), [ROOT / "userfuncs" / f"{request.param}.py"])


def coulomb_on(inputs):
    groups = FrictionInput(
        inputs[0], inputs[1], inputs[2:5], inputs[5:8], inputs[8:10], *inputs[10:13],
        inputs[13:16], inputs[16:19], *[0.0] * (len(FrictionInput._fields) - 10),
    )  # fmt: skip
    return FRICTION_LAWS["COULOMB_ON"].force(groups, *PAR)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
# no denormal forces: nothing agrees to 1e-12 there
@given(st.floats(-7, 3), st.floats(0, 6.3), st.just(0.0) | st.floats(1e-9, 1e4))
def test_shipped_examples_agree_with_coulomb_on(shipped, exponent, angle, nforce):
    speed = 10.0**exponent
    inputs = [*INPUTS]
    inputs[5:8] = [speed * math.cos(angle), speed * math.sin(angle), 0.3]
    inputs[10] = nforce
    wanted = coulomb_on(inputs)
    code, got = call(shipped, inputs)
    assert code == 0
    # the seed's first branch is h0 + (h1 - h0) s^2 (3 - 2 s): it cancels near v = 0
    near_zero = 4e-16 * PAR[0] * nforce if "seed" in shipped.source.stem else 0.0
    assert got == pytest.approx(wanted, rel=1e-12, abs=near_zero)
    interpreted = shipped.call(0.7, PAR, [0] * 3, [0] * 3, [0] * 3, inputs[5:8], nforce)
    assert interpreted == pytest.approx([got[0], got[1], got[4]], rel=1e-13, abs=near_zero)


def test_shipped_examples_compile_and_do_not_read_x(shipped):
    assert shipped.compiled
    assert shipped.reason == ""
    assert not shipped.uses_x
    assert shipped.par.tolist() == list(PAR)
    at_rest = [*INPUTS[:5], 0.0, 0.0, 0.0, *INPUTS[8:]]
    assert call(shipped, at_rest) == (0, [0.0] * 5)


def test_importing_the_package_does_not_import_numba():
    code = "import sys, mbsim.plugins; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_a_second_process_loads_from_the_cache(tmp_path):
    script = (
        "import sys, pathlib, mbsim.plugins as p\n"
        "from numba.core import event\n"
        "from mbsim.model.elements import Contact, Subroutine\n"
        "count = event.install_recorder('numba:compile')\n"
        "with count as seen:\n"
        "    u = p.load_friction(Contact(id=1, cff=Subroutine(par=(.05,.01,.1,.5),"
        "fnc_name='CFFSUB')), [pathlib.Path('userfuncs/seed_cffsub.py')])\n"
        "assert u.compiled, u.reason\n"
        "print(len(seen.buffer))\n"
    )
    env = {**os.environ, "MBSIM_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(PACKAGES)}

    def run():
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=ROOT, env=env, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return int(done.stdout), sorted(str(file) for file in tmp_path.rglob("*"))

    first, files = run()
    second, later = run()
    assert first > 0
    assert second == 0
    assert files == later
    assert any(file.endswith(".code") for file in files)


# -- the whitelist and the rewriting


@pytest.mark.parametrize(
    ("body", "result"),
    [
        # integers in lists: Numba alone would keep the list whole and the forces 0
        ("r = [0, 0, 0]\nr[0] = -0.5*xdot[0]\nreturn r", [-0.15, 0.0, 0.0]),
        ("k = 0\nr = [k]*3\nr[1] = 0.25\nreturn r", [0.0, 0.25, 0.0]),
        ("return [-nforce*v for v in xdot]", [-1.5, 2.0, -1.0]),
        ("r = []\nfor i in [0, 1, 2]:\n    r.append(par[i])\nreturn r", [0.05, 0.01, 0.1]),
        ("return (int(nforce)//2, 7 % 4, round(par[1]))", [2.0, 3.0, 0.0]),
        # the documented helpers, in all ways of reading what they return
        ("[mu, e] = py_step(0.25, 0, 1, 1, 3, 0)\nreturn [mu, e, 0]", [1.3125, 0.0, 0.0]),
        ("mu, e = py_step5(0.5, 0, 0, 1, 1, 1)\nreturn [mu, e, 0]", [1.875, 0.0, 0.0]),
        ("r = py_step(0.25, 0, 0, 1, 1, 2)\nreturn [r[0], r[1], 0]", [3.0, 0.0, 0.0]),
        ("r = py_step(1, 1, 0, 1, 1, 0)\nreturn [r[0], r[1], 0]", [0.0, 1.0, 0.0]),
        ("m, e = py_step(1,0,0,2,1,0)\npy_errmes(e, 'bad', id, 'STOP')\nreturn [m,0,0]",
         [0.5, 0.0, 0.0]),
        ("time = 3\nreturn [py_getstm(), time, py_get_contact_area()]", [0.7, 3.0, 0.0]),
        ("return [id, npar, len(xdot)]", [301001.0, 4.0, 3.0]),
        ("e = 2\nreturn [e, pi, xdot[-1]**2]", [2.0, math.pi, 0.2**2]),
    ],
)  # fmt: skip
def test_compiled_functions_do_what_python_does(load, body, result):
    user = load(body)
    assert user.compiled, user.reason
    code, got = call(user)
    assert code == 0
    assert [got[0], got[1], got[4]] == pytest.approx(result, rel=1e-15)
    assert got[2:4] == [0.0, 0.0]


def test_module_constants_functions_and_math_imports_compile(load):
    user = load(
        '"""doc"""\nimport math as m\nfrom math import hypot as length\n'
        "MU = 0.1 * 3\nSIDES = (1, -1)\n\n"
        "def sq(a: float) -> float:\n    'doc'\n    return a * a\n\n"
        f"def CFFSUB({ARGS}, gain=2):\n"
        "    v = length(xdot[0], xdot[1]) + m.sqrt(sq(xdot[2]))\n"
        "    return [MU * v * gain, SIDES[1], m.pi]\n"
    )
    assert user.compiled, user.reason
    assert call(user)[1] == pytest.approx([0.3 * 0.7 * 2, -1.0, 0.0, 0.0, math.pi])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("par[0] = 1.0\nreturn [0, 0, 0]", "writes into par"),
        ("print(time)\nreturn [0, 0, 0]", "computes and keeps nothing"),
        ("py_usrmes(1, 'a', id, 'INFO')\nreturn [0, 0, 0]", "computes and keeps nothing"),
        ("py_errmes(0, 'a', id, 'CONTINUE')\nreturn [0, 0, 0]", "goes on"),
        ("global n\nn = 1\nreturn [0, 0, 0]", "uses global"),
        ("try:\n    a = 1\nexcept Exception:\n    a = 2\nreturn [a, 0, 0]", "uses try"),
        ("f = lambda a: a\nreturn [0, 0, 0]", "uses Lambda"),
        ("return [float(f'{1}'), 0, 0]", "uses JoinedStr"),
        ("if nforce > 1:\n    mu = 1\nreturn [mu, 0, 0]", "may be read before it is set"),
        ("if nforce > 1:\n    return [0, 0, 0]", "may end without returning"),
        ("return [open('a'), 0, 0]", "calls open"),
        ("return [sum(xdot), 0, 0]", "calls sum; a loop compiles"),
        (f"import numpy as np\ndef CFFSUB({ARGS}):\n    return [np.linalg.norm(xdot), 0, 0]",
         "calls np.linalg.norm; hypot(x, y) compiles"),
        (f"import numpy as np\ndef CFFSUB({ARGS}):\n    return [np.tanh(nforce), 0, 0]",
         "calls np.tanh; tanh of math compiles"),
        (f"from numpy import tanh\ndef CFFSUB({ARGS}):\n    return [tanh(nforce), 0, 0]",
         "calls tanh; tanh of math compiles"),
        ("return [xdot.count(0), 0, 0]", "calls xdot.count"),
        (f"import random\ndef CFFSUB({ARGS}):\n    return [random.random(), 0, 0]", "random"),
        (f"n = 1\nn = 2\ndef CFFSUB({ARGS}):\n    return [n, 0, 0]", "uses n"),
        (f"n = 1\ndef g():\n    global n\ndef CFFSUB({ARGS}):\n    return [n, 0, 0]", "uses n"),
        (f"def f(a):\n    return f(a)\ndef CFFSUB({ARGS}):\n    return [f(1), 0, 0]"
         .replace("return f(a)", "return f(a) if a < 0 else 1"), "calls itself"),
        (f"def CFFSUB({ARGS}, *more):\n    return [0, 0, 0]", "arguments"),
        ("par = par + [1.0]\nreturn [par[4], 0, 0]", "does not compile"),
        ("if nforce > 1.0:\n    return (0.0, 0.0, 0.0)\nreturn [0.0, 0.0, 0.0]",
         "branches return different kinds"),
        ("return 2.0 * nforce", "what it returns is no list of numbers"),
        ("return [[0, 0, 0][i] for i in xdot[0:0]] + [par[4], 0, 0]", ""),
    ],
)  # fmt: skip
def test_everything_else_stays_interpreted_with_a_reason(load, text, reason):
    user = load(text)
    assert not user.compiled
    assert reason in user.reason
    assert any("stays interpreted" in line for line in load.log)


def test_a_function_that_differs_when_compiled_is_found_by_the_probes(load):
    # 2**64 does not fit a machine word; Python's integers grow
    user = load("n = 1\nfor i in range(64):\n    n = n * 2\nreturn [n * 1.0, 0, 0]")
    assert not user.compiled
    assert "when compiled and" in user.reason
    assert call(user)[1][0] == 2.0**64


def test_a_function_without_parameters_compiles(load):
    user = load("return [nforce, npar, 0]", par=())
    assert user.compiled, user.reason
    assert call(user) == (0, [5.0, 0.0, 0.0, 0.0, 0.0])
    assert call(load("return [nforce, len(par), 0]", par=(), interpret=True))[0] == 0


def test_interpret_leaves_it_interpreted(load):
    user = load("return [1, 2, 3]", interpret=True)
    assert not user.compiled
    assert user.reason == "--interpret-plugins"
    assert call(user) == (0, [1.0, 2.0, 0.0, 0.0, 3.0])


@pytest.mark.parametrize(
    ("body", "uses"),
    [
        ("return [x[0], 0, 0]", True),
        ("return [xdot[0], 0, 0]", False),
        ("return [locals()['x'][0], 0, 0]", True),
        ("x = 1\nreturn [0, 0, 0]", False),
    ],
)
def test_uses_x_follows_the_text(load, body, uses):
    assert load(body, interpret=True).uses_x is uses


# -- failures


FAILING = [
    ("return [1.0/(xdot[0]-xdot[0]), 0, 0]", "ZeroDivisionError"),
    ("return [sqrt(-nforce - 1), 0, 0]", "ValueError"),
    ("i = npar + 3\nr = [0, 0, 0]\nr[i] = 1.0\nreturn r", "IndexError"),
    ("i = npar + 3\nreturn [par[i], 0, 0]", "IndexError"),
    ("return [log(0.0*nforce), 0, 0]", "ValueError"),
    ("raise ValueError('my own words')", "my own words"),
    ("py_errmes(1, 'told to stop', id, 'stop')\nreturn [0, 0, 0]", "told to stop"),
    ("return [0, 0]", "returned 2 values"),
    ("return [nan, 0, 0]", "not 3 finite numbers"),
    ("return [0, inf, 0]", "not 3 finite numbers"),
]


@pytest.mark.parametrize(("body", "words"), FAILING)
def test_an_interpreted_failure_reaches_the_user(load, body, words):
    user = load(body, interpret=True)
    assert call(user)[0] == (100 if "told to stop" in words else 1)
    with pytest.raises(PluginError) as caught:
        plugins.raise_failure()
    text = str(caught.value)
    assert text.startswith("Force_Contact[301001]: CFFSUB failed at time 0.7: ")
    assert words in text
    assert "script.py" in text
    assert "mbsim/plugins" not in text
    assert caught.value.exit_code == 4
    assert plugins.failure.error is None


@pytest.mark.parametrize(("body", "words"), FAILING)
def test_a_compiled_failure_is_reproduced(load, body, words):
    user = load(body)
    code, out = call(user)
    assert code in (1, 2) or not all(map(math.isfinite, out))
    with pytest.raises(PluginError, match=words):
        plugins.reproduce(user, INPUTS, 301001)


def test_a_traceback_shows_the_users_frames_and_lines(load):
    user = load(
        f"def deeper(a):\n    return 1 / a\n\ndef CFFSUB({ARGS}):\n    return [deeper(0), 0, 0]\n",
        interpret=True,
    )
    assert call(user)[0] == 1
    with pytest.raises(PluginError) as caught:
        plugins.raise_failure()
    text = str(caught.value)
    assert "script.py:2" in text
    assert "ZeroDivisionError: division by zero" in text
    assert "return 1 / a" in text
    assert "in CFFSUB" in text
    assert text.count("File ") == 2


@pytest.mark.parametrize(
    "result",
    "None|'abc'|['a', 'b', 'c']|7|{1: 2}|[None]*3|[1j, 0, 0]|[10**400, 0, 0]|[0]*4|{1, 2, 3}".split(
        "|"
    ),
)
def test_what_is_no_force_is_refused(load, result):
    user = load(f"print(end='')\nreturn {result}")
    assert call(user)[0] == 1
    with pytest.raises(PluginError, match=r"returned .*not 3 finite numbers"):
        plugins.raise_failure()


@pytest.mark.parametrize("result", ["(1, 2, 3)", "numpy.array([1.0, 2.0, 3.0])", "[True, 2, 3.0]",
                                    "[numpy.float64(1), 2, 3]", "range(1, 4)"])  # fmt: skip
def test_any_sequence_of_three_numbers_is_a_force(load, result):
    user = load(f"import numpy\ndef CFFSUB({ARGS}):\n    return {result}\n", interpret=True)
    assert call(user) == (0, [1.0, 2.0, 0.0, 0.0, 3.0])


def test_ctrl_c_inside_a_function_stays_ctrl_c(load):
    user = load("if not iflag:\n    raise KeyboardInterrupt\nreturn [0.0, 0.0, 0.0]")
    # it is not asked again at another point, as one that raises is
    assert call(user)[0] == Code.STOPPED_BY_USER
    with pytest.raises(KeyboardInterrupt):
        plugins.raise_failure()


def test_a_function_cannot_change_what_the_host_handed_over(load):
    user = load("par[0] = 99.0\nxdot[0] = 99.0\nreturn [par[0], xdot[0], loci[2]]")
    assert call(user) == (0, [99.0, 99.0, 0.0, 0.0, 3.0])
    assert call(user)[0] == 0
    assert user.par[0] == 0.05


# -- finding and loading a script


def refused(match, *args, **words):
    with pytest.raises(ModelError, match=match) as caught:
        plugins.load_friction(*args, **words)
    return str(caught.value)


def test_naming_no_file_says_what_to_do():
    assert refused("names no file", contact()) == (
        'Force_Contact[301001]: cff_fnc_name="CFFSUB" names no file (cff_dll_name="NULL"); '
        "name one with --plugin FILE.py"
    )


def test_load_faults_name_file_and_line(tmp_path):
    good = f"def CFFSUB({ARGS}):\n    return [0, 0, 0]\n"

    def write(name, text):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    one, two = write("one.py", good), write("two.py", good)
    refused("missing.py: No such file", contact(), [tmp_path / "missing.py"])
    refused("defined twice: .*one.py.*two.py", contact(), [one, two])
    refused('"OTHER".*one.py defines CFFSUB', contact(fnc_name="OTHER"), [one])
    refused("defines no function", contact(), [write("none.py", "A = 1\n")])
    refused("is a int, not a function", contact(), [write("int.py", "CFFSUB = 3\n")])
    refused(r"few.py:1: CFFSUB\(a, b\) cannot", contact(),
            [write("few.py", "def CFFSUB(a, b):\n    pass\n")])  # fmt: skip
    refused("law.so: No such file", contact(), [tmp_path / "law.so"])
    refused("law: No such file", contact(dll_name="law"))
    refused(r"names no .m file; name CFFSUB.m by", contact(interpreter="MATLAB"))
    states = "CFFSUB_STATES = 2\n" + good
    refused(r"states.py:2: CFFSUB.*12 arguments", contact(), [write("states.py", states)])
    for count in ("-1", "65", "2.0", "True", "'2'"):
        refused(f"CFFSUB_STATES = {count}: a whole number from 0 to 64", contact(),
                [write("count.py", f"CFFSUB_STATES = {count}\n{good}")])  # fmt: skip
    text = refused("boom.py:2: the script fails", contact(), [write("boom.py", "a = 1\n1/0\n")])
    assert "ZeroDivisionError: division by zero" in text
    assert "\n" not in text
    refused("bad.py:1: ", contact(), [write("bad.py", "a = = 1\n")])
    refused("exit.py:1: .*SystemExit", contact(), [write("exit.py", "raise SystemExit\n")])
    refused("null", contact(), [write("null.py", "a = '\0'\n")])


def test_script_name_comes_before_plugin_files(tmp_path):
    for name in ("deck", "option"):
        (tmp_path / f"{name}.py").write_text(f"def CFFSUB({ARGS}):\n    return [0, 0, 0]\n")
    named = contact(script_name=str(tmp_path / "deck.py"))
    user = plugins.load_friction(named, [tmp_path / "option.py"], interpret=True)
    assert user.source.name == "deck.py"


def test_a_script_runs_once_for_all_contacts_of_a_run(tmp_path, capsys):
    file = tmp_path / "once.py"
    file.write_text(f"print('read')\ndef CFFSUB({ARGS}):\n    return [0, 0, 0]\n")
    scripts = {}
    for _ in range(2):
        plugins.load_friction(contact(), [file], interpret=True, scripts=scripts)
    said = capsys.readouterr()
    assert said.err.count("read") == 1
    assert said.out == ""


def test_bytecode_is_accepted_and_stays_interpreted(tmp_path):
    source, target = tmp_path / "law.py", tmp_path / "law.pyc"
    source.write_text(f"def CFFSUB({ARGS}):\n    return [1, 2, 3]\n")
    py_compile.compile(str(source), cfile=str(target), doraise=True)
    user = plugins.load_friction(contact(), [target], log=lambda line: None)
    assert (user.compiled, user.uses_x, user.reason) == (False, True, "a .pyc has no source")
    assert call(user)[0] == 0
    target.write_bytes(b"\0" * 20)
    refused("another version of Python", contact(), [target])


# -- what is wrong with a script

SEED = """def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):

    result = [000]

        mu_sta = float(par[0])
        mu_dyn = float(par[1])
        vs = float(par[2])
        vd = float(par[3])

        v = sqrt(xdot[0]*xdot[0]+xdot[1]*xdot[1])
        mu = 0.0
        if v>=vd:
            mu = mu_dyn
        elif v>vs:
            mu, errflg] = py_step(v, vs, mu_sta, vd, mu_dyn, 0)
        else:
            [mu, errflg] = py_step(v, -vs, -mu_sta, vs, mu_sta, 0)

                result[0] = -mu*(nforce)*xdot[0]/v
                result[1] = -mu*(nforce)*xdot[1]/v

        return result
"""


def printed(text):
    """Return text as the manual page has it: indented with non-breaking spaces."""
    lines = []
    for line in text.split("\n"):
        width = len(line) - len(line.lstrip())
        lines.append("\u00a0" * width + line[width:])
    return "\n".join(lines)


def test_the_printed_example_is_diagnosed_by_line(tmp_path):
    file = tmp_path / "seed.py"
    file.write_text(printed(SEED), encoding="utf-8")
    text = refused("is not valid Python", contact(), [file])
    found = {}
    for line in text.splitlines()[1:]:
        number, what = line.split("seed.py:")[1].split(": ", 1)
        found.setdefault(int(number), []).append(what)
    assert "non-breaking spaces (U+00A0)" in found[3][0]
    assert "3-22" in found[3][0]
    assert found[3][1].startswith("[000] is a list of one number: write [0.0, 0.0, 0.0]")
    assert found[5][0].startswith("indentation")
    assert found[15] == [
        "']' without '[': write '[mu, errflg] = py_step(v, vs, mu_sta, vd, mu_dyn, 0)'"
    ]
    assert found[19][0].startswith("indentation")
    assert "warning: divides by the slip speed v" in found[19][1]
    assert "warning: divides by the slip speed v" in found[20][0]
    assert sorted(found) == [3, 5, 15, 19, 20]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("def f(a):\n    b = 1\n      c = 2\n    return b\n", 3, "indentation: 6 columns"),
        ("def f(a):\nreturn a\n", 2, "indentation"),
        ("def f(a):\n        b = 1\n    return b\n", 3, "fit no block"),
        ("a = 'x]'\nb = (1,\n     2\n", 2, "'(' is never closed"),
        ("a = 1\nb = a)\n", 2, "')' without '('"),
        ("a\u2003= 1\nb = = 2\n", 1, "U+2003"),
        ("'''text ] [000]\n   more ]'''\nb = = 2\n", 3, "invalid syntax"),
        ("def f()\n    pass\n", 1, "expected ':'"),
    ],
)
def test_each_fault_is_found_alone(text, line, words):
    with pytest.raises(SyntaxError):
        compile(text, "f.py", "exec")
    found = plugins.diagnose(text, "f.py")
    assert any(item.startswith(f"  f.py:{line}: ") and words in item for item in found.split("\n"))
    assert plugins.diagnose(text.encode(), "f.py") == found


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("r = [000]\nreturn r", "[000] is a list of one number"),
        ("return [0, 0]", "a list of 2"),
        ("v = hypot(xdot[0], xdot[1])\nreturn [xdot[0]/v, 0, 0]", "divides by the slip speed v"),
        ("a = xdot[0]\nv = (a*a)**0.5\nif v > 0:\n    return [1/v, 0, 0]\nreturn [0, 0, 0]", ""),
        ("v = sqrt(xdot[0]**2)\nif v < 1e-9:\n    return [0, 0, 0]\nreturn [1/v, 0, 0]", ""),
        ("v = sqrt(xdot[0]**2 + 1e-9)\nreturn [1/v, 0, 0]", ""),
        ("v = sqrt(xdot[0]**2)\nreturn [1/v if v > 0 else 0, 0, 0]", ""),
        ("v = sqrt(xdot[0]**2)\nif v >= 0:\n    return [1/v, 0, 0]\nreturn [0, 0, 0]", "divides"),
    ],
)
def test_lint_warns_of_what_python_accepts(load, body, words):
    load(body, interpret=True)
    warnings = [line for line in load.log if "warning" in line]
    assert bool(warnings) == bool(words)
    assert not words or words in warnings[0]


# -- the py_ functions


@given(st.floats(-2, 3), st.floats(-5, 5), st.floats(-5, 5))
def test_py_step_and_its_derivatives_follow_the_closed_forms(x, h0, h1):
    s = min(max(x, 0.0), 1.0)
    inside = 1.0 if 0.0 < x < 1.0 else 0.0
    cubic = [h0 + (h1 - h0) * s * s * (3 - 2 * s), 6 * s * (1 - s), 6 - 12 * s]
    quintic = [h0 + (h1 - h0) * s**3 * (10 - 15 * s + 6 * s * s)]
    quintic += [30 * s**2 * (1 - s) ** 2, 60 * s - 180 * s**2 + 120 * s**3]
    for function, forms in ((helpers.py_step, cubic), (helpers.py_step5, quintic)):
        for order in range(3):
            wanted = forms[0] if order == 0 else (h1 - h0) * forms[order] * inside
            value, errflg = function(x, 0, h0, 1, h1, order)
            assert errflg == 0
            assert value == pytest.approx(wanted, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("function", [helpers.py_step, helpers.py_step5])
def test_py_step_flags_bad_arguments(function):
    assert function(0, 0, 0, 1, 1, 3) == function(0, 0, 0, 1, 1, -1) == [0.0, 1]
    assert function(0, 1, 0, 1, 1, 0) == function(0, 1, 0, 0, 1, 0) == [0.0, 1]


def test_messages_go_to_the_log_of_the_host(load, monkeypatch):
    lines = []
    monkeypatch.setattr(plugins.host, "log", lines.append)
    user = load(
        "py_usrmes(1, 'hello', id, 'INFO_NOPAD')\npy_usrmes(0, 'no', id, 'INFO')\n"
        "py_errmes(0, 'no', id, 'STOP')\npy_errmes(1, 'hm', id, 'CONTINUE')\n"
        "return [py_getstm(), 0, 0]"
    )
    lines.clear()  # the call with iflag 1 says the same
    assert call(user)[1][0] == 0.7
    assert lines == ["USRMES:USER [301001] INFO: hello", "ERRMES:USER [301001] ERROR: hm"]
    assert load.log
    assert np.isfinite(user.par).all()


# -- iflag and dflag


def test_an_interpreted_function_is_called_once_with_iflag(load):
    text = (
        "calls = []\n"
        f"def CFFSUB({ARGS}):\n"
        "    calls.append((iflag, dflag, time, nforce, x, xdot, par, npar))\n"
        "    d, errflg = py_sysfnc('dx', [20, 10.0])\n"
        "    v, errflg = py_sysary('TVEL', [par[0]])\n"
        "    d, errflg = py_sysfnc('DX', [20, 10])\n"
        "    return [v[0] / errflg, 0.0, 0.0] if errflg else [0.0, 0.0, 0.0]\n"
    )
    user = load(text, par=(5.0,))
    zeros = [0.0, 0.0, 0.0]
    calls = user.function.__globals__["calls"]
    assert calls == [(1, 0, 0.0, 0.0, zeros, zeros, [5.0], 1)]
    assert user.asked == ("DX 20 10", "TVEL 5")
    call(user, [*INPUTS[:19], 1.0, *INPUTS[20:]])
    assert [(flags[0], flags[1]) for flags in calls] == [(1, 0), (0, 1)]


def test_what_fails_under_iflag_is_said_and_is_no_fault(load):
    user = load("return [1.0 / nforce, 0.0, 0.0]", interpret=True)
    assert any("iflag 1 fails" in line and "ZeroDivisionError" in line for line in load.log)
    assert call(user)[1][0] == 1.0 / INPUTS[10]


def test_a_compiled_function_sees_dflag(load):
    user = load("if dflag:\n    return [1.0, 0.0, 0.0]\nreturn [2.0, 0.0, 0.0]")
    assert user.compiled
    assert call(user)[1][0] == 2.0
    assert call(user, [*INPUTS[:19], 1.0, *INPUTS[20:]])[1][0] == 1.0
