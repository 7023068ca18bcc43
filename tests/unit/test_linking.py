"""Roots link what they call: what is emitted, recursion, exceptions, the cache, Numba's costs."""

from __future__ import annotations

import ctypes
import functools
import math
import os
import subprocess
import sys
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba import boolean, float64, int64, njit
from numba.core import ir, targetconfig
from numba.core.compiler import CompilerBase, Flags, run_frontend
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python, rtsys
from numba.core.types import Array, Tuple

from helpers.folders import MODELS, PACKAGES
from mbsim.core import compiling, jit, linking, numba_costs
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.signature import FLOAT, INT

pytestmark = pytest.mark.skipif(linking.POLICY == "all", reason="Numba's own linking")

HELPERS = """
import math

from mbsim.core.jitable import jitable
from numba import njit


@jitable
def halved(x):
    return 0.5 * x


@jitable
def shifted(x):
    return math.sin(halved(x)) + 1.0


@njit
def even(n):
    return 1 if n == 0 else odd(n - 1)


@njit
def odd(n):
    return 0 if n == 0 else even(n - 1)


@njit
def factorial(n):
    return 1 if n < 2 else n * factorial(n - 1)


@jitable
def checked(x):
    if x < 0.0:
        raise ValueError("negative")
    return shifted(x)


def root(n, x):
    return 1000.0 * factorial(n) + 100.0 * even(n) + shifted(x) + checked(x)
"""

RUN = """
import ctypes, pathlib, sys
{before}
from mbsim.core import jit, linking
from mbsim.core.signature import FLOAT, INT
import helpers
found = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_double)(
    jit.address(helpers.root, FLOAT(INT, FLOAT))
)
called = jit.function(helpers.checked)
try:
    called(-1.0)
except ValueError as error:
    said = str(error)
print(found(5, 0.3).hex(), found(4, 0.3).hex(), called(2.0).hex(), said, linking.POLICY,
      "root" in linking.emitted, "shifted" in linking.emitted, jit.compile_seconds > 0.0)
"""


def in_a_process(folder, before=""):
    """Return what RUN prints in a process of its own, whose cache is in `folder`."""
    (folder / "plugins").mkdir(exist_ok=True)
    (folder / "plugins" / "helpers.py").write_text(HELPERS)
    path = os.pathsep.join([str(folder / "plugins"), str(PACKAGES)])
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(folder), "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", RUN.format(before=before)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_same_numbers_from_linked_roots_the_cache_and_numbas_own_linking(tmp_path):
    linked, cached = in_a_process(tmp_path), in_a_process(tmp_path)
    assert linked[3:] == ["negative", linking.POLICY, "True", "False", "True"]
    assert cached[3:] == ["negative", linking.POLICY, "False", "False", "False"]
    stock = in_a_process(tmp_path, 'import numba; numba.__version__ = "0.0.1"')
    assert stock[4:6] == ["all", "False"]
    assert linked[:3] == cached[:3] == stock[:3]
    assert float.fromhex(linked[0]) == pytest.approx(120002.3, abs=0.1)  # 5! and odd
    assert float.fromhex(linked[1]) == pytest.approx(24102.3, abs=0.1)  # 4! and even


NO_BITCODE = """
import llvmlite.binding as llvm
def parse_bitcode(data):
    raise AssertionError("parsed")
llvm.parse_bitcode = parse_bitcode
"""


def test_what_is_stored_is_loaded_without_its_bitcode(tmp_path):
    """To parse it took nine tenths of the time to load a method."""
    linked, cached = in_a_process(tmp_path), in_a_process(tmp_path, NO_BITCODE)
    assert cached[:3] == linked[:3]
    assert cached[7] == "False"


@jitable
def stored(x):
    return 3.0 * x


def test_a_stored_function_is_linked_into_another_root():
    compiling.register()
    codegen = cpu_target.target_context.codegen()
    compiled = njit(stored)
    assert compiled(2.0) == 6.0
    library = compiled.overloads[compiled.signatures[0]].library
    library.enable_object_caching()
    library._compiled_object = codegen._tm.emit_object(library._final_module)
    again = linking.RootLibrary._unserialize(codegen, library.serialize_using_object_code())
    assert again._shared_module is None
    name = next(f.name for f in library.get_defined_functions())
    assert again.get_pointer_to_function(name) != 0
    root = codegen.create_library("root")
    root.add_linking_library(again)
    text = f'declare void @"{name}"()\ndefine ptr @asked() {{ ret ptr @"{name}" }}'
    root._final_module.link_in(llvm.parse_assembly(text))
    root.finalize()
    assert {"asked", name} <= {f.name for f in root.get_defined_functions()}


@jitable
def inner_most(x):
    return 3.0 * x


@jitable
def inner(x):
    return inner_most(x) + 1.0


def test_only_roots_are_emitted_and_an_inner_function_is_shared():
    def first(x):
        return inner(x)

    def second(x):
        return 2.0 * inner(x)

    jit.address(lambda x: x, FLOAT(FLOAT))  # with it the runtime's own functions
    before = list(linking.emitted)
    for function in (first, second):
        jit.address(function, FLOAT(FLOAT))
    new = linking.emitted[len(before) :]
    assert [name.rsplit(".", 1)[-1] for name in new] == ["first", "second"]


@jitable
def leaf(x):
    return x * x


@jitable
def branch(x):
    return leaf(x) + 1.0


def test_what_a_root_and_an_inner_function_call_is_compiled_once(monkeypatch):
    compiling.register()
    seen = []
    compile_extra = CompilerBase.compile_extra

    def noted(self, function):
        seen.append(function.__name__)
        return compile_extra(self, function)

    monkeypatch.setattr(CompilerBase, "compile_extra", noted)

    def root(x):
        return leaf(x) + branch(x)

    jit.address(root, FLOAT(FLOAT))
    assert seen.count("leaf") == seen.count("branch") == seen.count("root") == 1


def test_callers_with_other_options_get_forms_of_their_own():
    compiling.register()

    @jitable
    def quotient(x):
        return 1.0 / x

    compiling.register()
    inherits = njit(error_model="numpy")(lambda x: quotient(x))
    assert inherits(0.0) == math.inf
    strict, loose = (njit(error_model=model)(lambda x: 1.0 / x) for model in ("python", "numpy"))
    with pytest.raises(ZeroDivisionError):
        njit(error_model="python")(lambda x: strict(x))(0.0)
    assert njit(error_model="numpy")(lambda x: loose(x))(0.0) == math.inf


def test_an_inner_function_is_emitted_when_python_calls_it():
    called = njit(lambda x: x + 1.0)
    root = njit(lambda x: 2.0 * called(x))
    assert root(1.0) == 4.0
    assert called(1.0) == 2.0


def test_options_are_equal_as_numba_says():
    flags = []
    for name, value in (
        ("nrt", True),
        ("nrt", False),
        ("forceinline", True),
        ("boundscheck", None),
    ):
        one = Flags()
        setattr(one, name, value)
        flags.append(one)
    flags += [Flags(), flags[0].copy()]
    for a in flags:
        for b in flags:
            assert (a == b) == numba_costs._equal_options(a, b)
            assert hash(a) == hash(tuple(sorted(b.values())))
    assert flags[0] != 1
    assert targetconfig.TargetConfig.__eq__ is numba_costs._same_options


def by_numbas_rule(part):
    """List variables as Numba's own method does it, written down anew."""
    if isinstance(part, ir.Var):
        return [part]
    if isinstance(part, ir.Inst):
        return part.list_vars()
    if isinstance(part, list | tuple | dict):
        inner = part.values() if isinstance(part, dict) else part
        return [v for p in inner for v in by_numbas_rule(p)]
    return []


def test_variables_of_statements_are_listed_as_numba_does():
    def sample(a, n):
        total = 0.0
        for k in range(n):
            total += a[k, 0] * (a[k, 1:3].sum() if n > 2 else -1.0)
        return total, (a, n)

    listed = 0
    for block in run_frontend(sample).blocks.values():
        for statement in block.body:
            assert statement.list_vars() == by_numbas_rule(statement.__dict__)
            listed += len(statement.list_vars())
    assert listed > 30


def test_types_of_mixed_operators_are_as_before():
    @njit
    def mixed(a, x, n):
        return (a + x)[0] + (x * n) ** 2 + n // 2

    assert mixed(np.array([1.5]), 0.5, 4) == 2.0 + 4.0 + 2
    assert mixed.nopython_signatures[0].return_type == float64
    assert int64 in mixed.nopython_signatures[0].args


def closures_and_lists(n):
    def doubled(k):
        return 2 * k

    squares = [k * k for k in range(n)]
    table = np.array([[k + j for k in range(3)] for j in range(2)])
    return doubled(n) + sum(squares), table, np.array([1, 2, n])


def whole_arrays(n):
    a = np.arange(float(n))
    b = np.sin(a) * 2.0 - a / (1.0 + a)
    return b, -b, np.maximum(a, b) + 1, (a, (b, 1.0), [a, b])


@njit
def steps(n):
    for k in range(n):
        a = np.ones(k)
        yield a.sum()


def drawn(n):
    total = 0.0
    for value in steps(n):
        total += value
    return total


@pytest.mark.parametrize("function", [closures_and_lists, whole_arrays, drawn])
def test_what_numba_rewrites_gives_what_python_gives(function):
    compiling.register()

    def flat(value):
        if isinstance(value, tuple | list):
            return [number for each in value for number in flat(each)]
        return np.ravel(value).tolist()

    compiled = njit(function)
    for _ in range(3):
        assert flat(compiled(4)) == pytest.approx(flat(function(4)), rel=1e-15)


def test_references_are_counted_and_given_back():
    compiling.register()

    @njit
    def kept(n):
        last = (np.zeros(1), 0)
        for k in range(n):
            a = np.full(3, float(k))
            last = (a, k)
        return last[0]

    kept(1)
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        assert kept(50).tolist() == [49.0] * 3
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free > 50


def test_an_error_is_told_with_where_it_is():
    compiling.register()

    @njit
    def wrong(x):
        return x + "text"

    with pytest.raises(TypingError, match="During: typing of") as caught:
        wrong(1.0)
    assert "def wrong(x):" in str(caught.value)


def test_sizes_of_types_are_as_llvm_says():
    context = cpu_target.target_context
    compiling.register()
    for kind in (float64, int64, Tuple((int64, boolean)), Array(float64, 2, "C")):
        laid_out = context.get_value_type(kind)
        for _ in range(2):
            size = context.get_abi_sizeof(laid_out)
            assert size == laid_out.get_abi_size(context.target_data)
            alignment = context.get_abi_alignment(laid_out)
            assert alignment == laid_out.get_abi_alignment(context.target_data)


PAIR = """
from mbsim.core import jit
from mbsim.geometry.catalog import PAIRS
from mbsim.laws.catalog import NORMAL_LAWS
from mbsim.laws import abi
from mbsim.compile_model.contacts import pair_address, region_address
pair_address(PAIRS["SPHERE-PLANE"]), region_address("BOX-PLANE")
abi.normal_address(NORMAL_LAWS["IMPACT"])
print(jit.compile_seconds > 0.0)
"""


def test_what_is_compiled_for_a_scene_is_found_again_by_the_next_process(tmp_path):
    environment = {**os.environ, "MBSIM_CACHE_DIR": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", PAIR],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
        ).stdout.split()
        for _ in range(2)
    ]
    assert said == [["True"], ["False"]]


def sums_and_branches(a, n):
    best, at = -1.0, -1
    if n > 3:
        scale = 2.0
    else:
        scale = -1.0
    row, last = a[1], a[-1, -1]
    for k in range(n):
        pair = (a[k, 0], a[k, 1] * scale)
        if pair[1] > best:
            best, at = pair[1], k
            continue
        for value in pair:
            best += 0.125 * value
            row[0] = best
    return best, at, row[0], last, a[at, 0] if at >= 0 else scale


def caught(a, n):
    try:
        total = checked_sum(a, n)
    except Exception:
        return -1.0
    return total


@jitable
def checked_sum(a, n):
    if n > len(a):
        raise ValueError("too many")
    return a[:n].sum()


def kept_of_each(n):
    last = np.zeros(2)
    for k in range(n):
        made = np.full(2, float(k))
        if k % 2 == 0:
            last = made
    return last[0] + made[1]


@pytest.mark.parametrize(
    ("function", "make"),
    [
        (sums_and_branches, lambda: (np.arange(12.0).reshape(6, 2) - 3.5, 6)),
        (sums_and_branches, lambda: (np.arange(4.0).reshape(2, 2), 2)),
        (caught, lambda: (np.arange(3.0), 3)),
        (caught, lambda: (np.arange(3.0), 4)),
        (kept_of_each, lambda: (5,)),
    ],
)
def test_plain_code_gives_what_python_gives(function, make):
    compiling.register()
    assert njit(error_model="numpy")(function)(*make()) == function(*make())


def test_variables_assigned_once_take_no_memory():
    compiling.register()

    @njit
    def placed(a, x):
        shift = 2.0 * x
        if x > 0.0:
            return shift + a[1, 2]
        return shift - a[0, 1]

    assert placed(np.ones((2, 3)), 1.0) == 3.0
    kinds = placed.nopython_signatures[0].args
    library = placed.overloads[kinds].library
    own = library._as_lowered or library._final_module
    text = next(str(f) for f in own.functions if "placed" in f.name and not f.is_declaration)
    assert "alloca" not in text


def test_uses_and_definitions_are_numbas():
    def numbas(blocks):
        """Find them as Numba's own function does it, written down anew."""
        used, defined = {}, {}
        for at, block in blocks.items():
            used[at], defined[at] = set(), set()
            for statement in block.body:
                names = {v.name for v in by_numbas_rule(statement.__dict__)}
                if isinstance(statement, ir.Assign):
                    read = {v.name for v in by_numbas_rule(statement.__dict__["value"])}
                    if statement.target.name not in read:
                        defined[at].add(statement.target.name)
                used[at] |= names - defined[at]
        return used, defined

    for function in (sums_and_branches, kept_of_each, checked_sum):
        blocks = run_frontend(function).blocks
        found = numba_costs._uses_and_definitions(blocks)
        assert (found.usemap, found.defmap) == numbas(blocks)


def test_a_location_is_taken_by_who_names_it():
    def without(a, b):
        return a

    def with_it(a, *, loc=None):
        return loc

    @functools.wraps(with_it)
    def wraps_it(*args, **kwargs):
        return with_it(*args, **kwargs)

    for function in (without, with_it, wraps_it, functools.partial(with_it, 1)):
        assert numba_costs._takes_location(function) == numba_costs._has_location(function)


@jitable
def _largest(values):
    found = values[0]
    for value in values[1:]:
        found = max(found, value)
    return found


def test_who_uses_an_array_is_counted_only_where_some_are_made():
    values = np.array([1.0, 3.0, 2.0])

    def passes_on(address, count):
        return _largest(floats_at(address, count))

    def makes(address, count):
        return _largest(floats_at(address, count) + np.zeros(count))

    signature = FLOAT(INT, INT)
    for function, allocates in ((passes_on, False), (passes_on, True), (makes, True)):
        jit._kept.pop((function, signature), None)
        jit._known.clear()
        found = jit.address(function, signature, allocates)
        kept = str(jit._kept[function, signature]._library._final_module)
        assert ("NRT_incref" in kept or "NRT_decref" in kept) == (function is makes)
        called = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_int64)(found)
        assert called(values.ctypes.data, 3) == 3.0
    del jit._kept[makes, signature]
    jit._known.clear()
    with pytest.raises(TypingError):
        jit.address(makes, signature)


class _Wide(NamedTuple):
    x: float
    y: float
    z: float
    unread: float


@jitable
def _length(p):
    return math.sqrt(p.x * p.x + p.y * p.y + p.z * p.z)


@njit
def _lengths(p, n):
    if n == 0:
        return _length(p)
    return _length(p) + _lengths(p, n - 1)


def test_what_a_root_links_in_is_its_own_and_takes_what_it_reads():
    def root(n, x):
        return _lengths(_Wide(x, 2.0 * x, 2.0 * x, 7.0), n)

    signature = FLOAT(INT, FLOAT)
    found = jit.address(root, signature)
    functions = [
        f
        for f in jit._kept[root, signature]._library._final_module.functions
        if not f.is_declaration
    ]
    linked = [f for f in functions if "_length" in f.name]
    assert [f.name for f in linked if f.linkage != llvm.Linkage.internal] == []
    # a recursive function stays one; beside x, y, z and n it may return a number and an error
    assert [len(list(f.arguments)) <= 6 for f in linked] == [True]
    assert ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_double)(found)(3, 0.5) == 6.0


COMPILED = """
import sys
import mbsim
from mbsim.core import compiling, jit
from numba.core.lowering import Lower
compiling.register()
lower, names = Lower.lower, set()

def noted(self):
    function = self.func_ir.func_id.func
    names.add(f"{function.__module__}.{function.__qualname__}")
    lower(self)

Lower.lower = noted
model, method = mbsim.read_model(sys.argv[1]), sys.argv[2]
mbsim.simulate(model, integrator=method, end_time=1e-3, print_interval=1e-3)
print(*sorted(names))
"""


#: Of contacts, sensors and forces that change their branch.
CONTACTS = (
    "mbsim.dynamics.contact mbsim.dynamics.stiction mbsim.dynamics.events mbsim.laws "
    "mbsim.geometry mbsim.dynamics.linearization.contact_slopes "
    "mbsim.dynamics.linearization.memory_slopes"
)
BRANCHES = (
    "mbsim.integrators.branches mbsim.integrators.events mbsim.dynamics.events.switching "
    "mbsim.dynamics.events.hidden "
)
#: Of contacts that a scene may lack: friction in steps of fixed length, pairs without a closed
#: form, flat faces that are one incident, bodies that stand on a rim.
OF_SOME_CONTACTS = (
    "contact.fixed_step detection.bounding_gap detection.another_point contact.rims "
    "add_region_stiffness add_moves_of_centre "
    "contact.tilting contact.spreading points.keep_slots points.exchange "
)
#: Of joints, forces, expressions; of friction with memory, and faces that are one incident.
MECHANISMS = (
    "mbsim.dynamics.stiction mbsim.dynamics.constraints mbsim.dynamics.forces. "
    "mbsim.dynamics.expressions mbsim.dynamics.contact.memory "
)


@pytest.mark.parametrize(
    ("deck", "method", "lacks"),
    [
        ("four_bar", "AUTO", CONTACTS + " mbsim.dynamics.linearization " + BRANCHES),
        ("four_bar", "RADAU5", CONTACTS + " " + BRANCHES),
        ("four_bar", "GALPHA", CONTACTS + " " + BRANCHES),
        # free bodies alone: what bounds its steps is in `events`
        (
            "free_top",
            "VERLET",
            CONTACTS.replace("events", "events.contact_stability")
            + " mbsim.dynamics.events.step_limits mbsim.dynamics.linearization "
            + MECHANISMS
            + BRANCHES,
        ),
        (
            "bowling_ball",
            "AUTO",
            MECHANISMS + BRANCHES + OF_SOME_CONTACTS + "mbsim.dynamics.linearization",
        ),
        ("bowling_ball", "RADAU5", BRANCHES + OF_SOME_CONTACTS),
    ],
)
@pytest.mark.slow
def test_a_deck_compiles_nothing_of_what_it_lacks(deck, method, lacks, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", COMPILED, str(MODELS / f"{deck}.xml"), method],
        capture_output=True,
        text=True,
        env={**os.environ, "MBSIM_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(MODELS.parent)},
    )
    assert done.returncode == 0, done.stderr
    modules = [name for name in done.stdout.split() if name.startswith("mbsim.")]
    assert "mbsim.dynamics.pipeline.evaluate.evaluate" in modules
    assert not [name for name in modules if any(part in name for part in lacks.split())]
