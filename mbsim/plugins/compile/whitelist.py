"""Which user functions may be compiled: a whitelist on the syntax tree.

A function passes if its text uses only its parameters, its locals, numbers of its module,
`math`, helper names, and functions of its module that pass as well. Python and compiled
code differ where a local is read before it is set, where a function ends without a value,
and where a list is written through a parameter: such functions do not pass either.
It is a whitelist, not a proof; the probes of `probe` have the last word.
"""

from __future__ import annotations

import ast
import copy
import math
import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

#: `math` names whose compiled twin behaves as Python's at every number
MATH_PLAIN = frozenset(
    "fabs atan atan2 asinh tanh erf erfc copysign degrees radians isfinite isinf isnan".split()
)
#: `math` names that raise in Python; `kernels` has their checked twins, and the count of arguments
MATH_CHECKED = {
    name: 2 if name in ("hypot", "fmod", "pow") else 1
    for name in (
        "sqrt hypot fmod pow log log10 log1p exp expm1 sinh cosh sin cos tan asin acos acosh "
        "atanh floor ceil trunc"
    ).split()
}
MATH_CONSTANTS = frozenset({"pi", "e", "tau", "inf", "nan"})
BUILTINS = frozenset("abs min max float int len range round bool".split())
#: What compiles in place of functions that do not, mostly numpy's.
INSTEAD = {
    "norm": "hypot(x, y)",
    "array": "a list",
    "asarray": "a list",
    "zeros": "a list",
    "clip": "min(max(x, low), high)",
    "sign": "copysign(1.0, x)",
    "absolute": "abs(x)",
    "maximum": "max(x, y)",
    "minimum": "min(x, y)",
    "power": "x ** y",
    "square": "x * x",
    "arctan": "atan(x)",
    "arctan2": "atan2(y, x)",
    "dot": "a sum of products",
    "sum": "a loop",
}
HELPERS = {"py_step": 6, "py_step5": 6, "py_getstm": 0, "py_get_contact_area": 0, "py_errmes": 4}
_ERRORS = frozenset("ValueError ArithmeticError ZeroDivisionError RuntimeError".split())

_PLAIN_NODES = (
    ast.Constant, ast.Name, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp,
    ast.Subscript, ast.Slice, ast.List, ast.Tuple, ast.operator, ast.unaryop, ast.boolop,
    ast.cmpop, ast.expr_context, ast.comprehension,
    ast.Pass, ast.Break, ast.Continue,
)  # fmt: skip
_REFUSED_OPERATORS = (ast.MatMult, ast.In, ast.NotIn, ast.Is, ast.IsNot)


class _WithoutText(ast.NodeTransformer):
    """Numbers in place of texts, which a signal may be."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.copy_location(ast.Constant(0), node) if isinstance(node.value, str) else node


class Refused(Exception):
    """A function stays interpreted; the text is the reason, with its line."""


def refuse(node: ast.AST, reason: str) -> Refused:
    """Return the exception for a node of the tree."""
    return Refused(f"line {getattr(node, 'lineno', 0)}: {reason}")


@dataclass
class Globals:
    """The names of a script's module, by what compiled code may do with them."""

    constants: dict[str, Any] = field(default_factory=dict)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    math_names: dict[str, str] = field(default_factory=dict)
    math_modules: set[str] = field(default_factory=set)
    others: set[str] = field(default_factory=set)
    spies: set[str] = field(default_factory=set)

    def is_espy(self, name: str, local: set[str]) -> bool:
        """Return whether a name is mbsim's `espy`, given or imported."""
        given = name == "espy" and self.kind(name) == ("other", name) and name not in self.others
        return name not in local and (given or name in self.spies)

    def kind(self, name: str) -> tuple[str, str]:
        """Return what a global name is (constant, function, math, module, helper, builtin)."""
        if name in self.constants:
            return "constant", name
        if name in self.functions:
            return "function", name
        if name in self.math_names:
            return "math", self.math_names[name]
        if name in self.math_modules:
            return "module", "math"
        if name in self.others:
            return "other", name
        if name in HELPERS:
            return "helper", name
        if hasattr(math, name):
            return "math", name
        return ("builtin", name) if name in BUILTINS else ("other", name)


def _module_nodes(tree: ast.Module) -> list[ast.AST]:
    """Return the nodes that run at import: not the bodies of functions and classes."""
    found: list[ast.AST] = []
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        found.append(node)
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)):
            waiting.extend(ast.iter_child_nodes(node))
    return found


def _times_bound(tree: ast.Module) -> Counter[str]:
    """Return how often a module binds each of its names; more than once under `global`."""
    bound: Counter[str] = Counter()
    for node in _module_nodes(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, (ast.Store, ast.Del)):
            bound[node.id] += 1
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            bound[node.name] += 1
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            for alias in node.names:
                bound[(alias.asname or alias.name).split(".")[0]] += 1
        elif isinstance(node, ast.ExceptHandler) and node.name:
            bound[node.name] += 1
    for node in ast.walk(tree):
        if isinstance(node, ast.Global):
            bound.update(name for name in node.names for _ in range(2))
    return bound


def _constants(bound: Counter[str], values: dict[str, Any]) -> dict[str, Any]:
    """Return the names bound once, to a number or a tuple of numbers."""
    constants: dict[str, Any] = {}
    # the value counts, not how it was computed: DRAG = 0.5 * rho * area is a number
    for name, count in bound.items():
        value = values.get(name)
        numbers = value if isinstance(value, tuple) and value else (value,)
        if count == 1 and all(isinstance(number, (int, float)) for number in numbers):
            if all(isinstance(number, float) or abs(number) < 2**62 for number in numbers):
                constants[name] = value
    return constants


def _imported(node: ast.Import | ast.ImportFrom, bound: Counter[str], known: Globals) -> None:
    """Add what an import at the top of a module brings of `math` and of mbsim's `espy`."""
    names = {alias.asname or alias.name: alias.name for alias in node.names}
    once = {name: of for name, of in names.items() if bound[name] == 1}
    if isinstance(node, ast.Import):
        known.math_modules.update(name for name, of in once.items() if of == "math")
    elif node.module == "math" and not node.level:
        known.math_names.update((name, of) for name, of in once.items() if of != "*")
    elif node.module == "mbsim" and not node.level:
        known.spies.update(name for name, of in once.items() if of == "espy")


def module_globals(tree: ast.Module, values: dict[str, Any]) -> Globals:
    """Sort the names that a module binds; `values` is its namespace after it has run."""
    bound = _times_bound(tree)
    known = Globals(constants=_constants(bound, values))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and bound[node.name] == 1:
            known.functions[node.name] = node
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            _imported(node, bound, known)
    sorted_names = {*known.constants, *known.functions, *known.math_names, *known.math_modules}
    known.others = set(bound) - sorted_names - {"*"}
    if any(
        alias.name == "*" and isinstance(node, ast.ImportFrom) and node.module != "math"
        for node in _module_nodes(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    ):
        raise Refused("the module imports * from another module")
    return known


def local_names(function: ast.FunctionDef) -> set[str]:
    """Return the parameters and the names that a function binds."""
    names = {arg.arg for arg in (*function.args.posonlyargs, *function.args.args)}
    for node in ast.walk(function):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def check(name: str, known: Globals) -> list[str]:
    """Return the functions that `name` needs, callees first, or raise `Refused`."""
    order: list[str] = []
    open_calls: list[str] = []

    def visit(wanted: str) -> None:
        if wanted in open_calls:
            raise refuse(known.functions[wanted], f"{wanted} calls itself")
        if wanted not in order:
            open_calls.append(wanted)
            for callee in _Check(known.functions[wanted], known).run():
                visit(callee)
            open_calls.pop()
            order.append(wanted)

    if name not in known.functions:
        raise Refused(f"{name} is not one plain function at the top of its module")
    visit(name)
    return order


class _Check:
    """The check of one function; `run` returns the module's functions that it calls."""

    def __init__(self, function: ast.FunctionDef, known: Globals) -> None:
        self.function, self.known = function, known
        self.locals = local_names(function)
        self.parameters = {arg.arg for arg in (*function.args.posonlyargs, *function.args.args)}
        self.callees: list[str] = []

    def run(self) -> list[str]:
        function, args = self.function, self.function.args
        if function.decorator_list:
            raise refuse(function, f"{function.name} is decorated")
        if args.vararg or args.kwarg or args.kwonlyargs:
            raise refuse(function, f"{function.name} takes * or ** arguments")
        for default in args.defaults:
            if not (isinstance(default, ast.Constant) and isinstance(default.value, (int, float))):
                raise refuse(default, "a default that is not a number")
        for name in self.locals:
            if name.startswith("mbsim_") or name in ("float", "len", "range"):
                raise refuse(function, f"a local name {name}")
        body = function.body
        if ast.get_docstring(function, clean=False) is not None:
            body = body[1:]
        if self.block(body, set(self.parameters)) is not None:
            raise refuse(function, f"{function.name} may end without returning a value")
        return self.callees

    # -- statements: each returns the names surely set after it, None if nothing follows it

    def block(self, body: list[ast.stmt], known: set[str]) -> set[str] | None:
        names: set[str] | None = set(known)
        for statement in body:
            # what stands behind a return is never run, but it must still be harmless
            after = self.statement(statement, set(self.locals) if names is None else names)
            names = None if names is None else after
        return names

    def statement(self, node: ast.stmt, known: set[str]) -> set[str] | None:
        if isinstance(node, (ast.Assign, ast.AugAssign, ast.AnnAssign)):
            return self.assignment(node, known)
        if isinstance(node, ast.If):
            self.expression(node.test, known)
            ends = [self.block(node.body, known), self.block(node.orelse, known)]
            reached = [names for names in ends if names is not None]
            return set.intersection(*reached) if reached else None
        if isinstance(node, (ast.For, ast.While)):
            if node.orelse:
                raise refuse(node, "a loop with else")
            inside = set(known)
            if isinstance(node, ast.For):
                self.expression(node.iter, known)
                inside |= self.targets(node.target, known)
            else:
                self.expression(node.test, known)
            self.block(node.body, inside)
            return known
        if isinstance(node, ast.Return):
            if node.value is None:
                raise refuse(node, "return without a value")
            self.expression(node.value, known)
            return None
        if isinstance(node, ast.Expr):
            return self.lone_expression(node.value, known)
        if isinstance(node, (ast.Break, ast.Continue)):
            return None
        if isinstance(node, ast.Raise):
            error = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if not isinstance(error, ast.Name) or error.id not in _ERRORS or node.cause:
                raise refuse(node, "raises something else than a plain error")
            return None
        if isinstance(node, ast.Pass):
            return known
        raise refuse(node, f"uses {type(node).__name__.lower()}")

    def assignment(
        self, node: ast.Assign | ast.AugAssign | ast.AnnAssign, known: set[str]
    ) -> set[str]:
        if node.value is None:
            raise refuse(node, "an annotation without a value")
        self.expression(node.value, known)
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            self.expression(ast.copy_location(ast.Name(node.target.id, ast.Load()), node), known)
        names = set(known)
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            names |= self.targets(target, known)
        return names

    def targets(self, target: ast.expr, known: set[str]) -> set[str]:
        """Return the names that an assignment sets, after a look at where it writes."""
        if isinstance(target, ast.Name):
            return {target.id}
        if isinstance(target, (ast.Tuple, ast.List)):
            return set().union(*(self.targets(part, known) for part in target.elts))
        if isinstance(target, ast.Subscript) and isinstance(target.value, ast.Name):
            name = target.value.id
            if name in self.parameters or name not in self.locals:
                raise refuse(target, f"writes into {name}, which is not its own")
            self.expression(target.value, known, reading=target.value)
            self.expression(target.slice, known)
            return set()
        raise refuse(target, "writes into something else than its own variables")

    def lone_expression(self, value: ast.expr, known: set[str]) -> set[str]:
        if isinstance(value, ast.Constant):
            return known
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
            if self.known.is_espy(value.func.id, self.locals):
                self.espy(value, known)
                return known
            if value.func.id == "py_errmes" and self.known.kind("py_errmes")[0] == "helper":
                self.errmes(value, known)
                return known
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute):
            owner = value.func.value
            if value.func.attr == "append" and isinstance(owner, ast.Name):
                if owner.id in self.locals - self.parameters and len(value.args) == 1:
                    self.expression(owner, known)
                    self.expression(value.args[0], known)
                    return known
        raise refuse(value, "a statement that computes and keeps nothing")

    def espy(self, call: ast.Call, known: set[str]) -> None:
        """Accept signals that only compute: the call is left out, they must not raise unseen."""
        if call.args or any(keyword.arg is None for keyword in call.keywords):
            raise refuse(call, "espy without names: espy(mu=mu)")
        for keyword in call.keywords:
            self.expression(_WithoutText().visit(copy.deepcopy(keyword.value)), known)

    def errmes(self, call: ast.Call, known: set[str]) -> None:
        """Accept py_errmes only where it stops the run: the interpreted twin then says why."""
        if len(call.args) != 4 or call.keywords or not isinstance(call.args[3], ast.Constant):
            raise refuse(call, "py_errmes without a fixed end flag")
        from mbsim.plugins.helpers import stops

        if not stops(call.args[3].value):
            raise refuse(call, "py_errmes that writes to the log and goes on")
        self.expression(call.args[0], known)

    # -- expressions

    def expression(self, root: ast.expr, known: set[str], reading: ast.expr | None = None) -> None:
        for node in self._walk(root):
            if isinstance(node, _REFUSED_OPERATORS):
                raise refuse(root, f"uses the operator {type(node).__name__.lower()}")
            if isinstance(node, ast.Call):
                self.call(node)
            elif isinstance(node, ast.Constant):
                if not isinstance(node.value, (int, float)) or abs(node.value) > 1e300:
                    raise refuse(node, f"uses the constant {node.value!r}")
                if isinstance(node.value, int) and abs(node.value) >= 2**62:
                    raise refuse(node, "uses an integer of more than 62 bits")
            elif isinstance(node, ast.ListComp):
                if len(node.generators) != 1 or node.generators[0].is_async:
                    raise refuse(node, "a comprehension of several loops")
                known = known | self.targets(node.generators[0].target, known)
            elif isinstance(node, ast.Name):
                if node is not reading and isinstance(node.ctx, ast.Load):
                    self.read(node, known)
            elif isinstance(node, ast.Attribute):
                self.math_name(node)
            elif not isinstance(node, _PLAIN_NODES):
                raise refuse(node, f"uses {type(node).__name__}")

    def _walk(self, root: ast.expr) -> list[ast.AST]:
        """Return the nodes of an expression, without the names that `call` looks at."""
        found: list[ast.AST] = []
        waiting: list[ast.AST] = [root]
        while waiting:
            node = waiting.pop(0)
            found.append(node)
            if isinstance(node, ast.Call):
                waiting.extend(node.args)
            elif not isinstance(node, ast.Attribute):
                waiting.extend(ast.iter_child_nodes(node))
        return found

    def read(self, node: ast.Name, known: set[str]) -> None:
        if node.id in self.locals:
            if node.id not in known:
                raise refuse(node, f"{node.id} may be read before it is set")
            return
        kind, name = self.known.kind(node.id)
        if kind == "constant" or (kind == "math" and name in MATH_CONSTANTS):
            return
        raise refuse(node, f"uses {node.id}, which is no number of its module")

    def math_name(self, node: ast.Attribute) -> None:
        if isinstance(node.value, ast.Name) and node.value.id not in self.locals:
            if self.known.kind(node.value.id)[0] == "module" and node.attr in MATH_CONSTANTS:
                return
        raise refuse(node, f"reads the attribute .{node.attr}")

    def call(self, node: ast.Call) -> None:
        kind, name = callee(node, self.known, self.locals)
        if node.keywords or any(isinstance(arg, ast.Starred) for arg in node.args):
            raise refuse(node, f"calls {name} with keywords or *")
        count = len(node.args)
        if kind == "math" and (name in MATH_PLAIN or MATH_CHECKED.get(name) == count):
            return
        if kind == "helper" and HELPERS[name] == count and name != "py_errmes":
            if name in ("py_getstm", "py_get_contact_area"):
                # only the subroutine itself is handed time and area
                if len(self.parameters) < 11:
                    raise refuse(node, f"{name} outside the subroutine itself")
            return
        if kind == "builtin" and name in BUILTINS:
            return
        if kind == "function":
            self.callees.append(name)
            return
        raise refuse(node, f"calls {name}{instead_of(name, kind)}")


def instead_of(name: str, kind: str) -> str:
    """Return what compiles in place of a call, ``; hypot(x, y) compiles``, or nothing.

    `kind` is that of `callee`: NumPy's `tanh` may be called by that name alone.
    """
    last = name.rpartition(".")[2]
    if last in MATH_PLAIN or last in MATH_CHECKED:
        return f"; {last} of math compiles" if kind == "other" else ""
    return f"; {INSTEAD[last]} compiles" if last in INSTEAD else ""


def callee(node: ast.Call, known: Globals, local: set[str]) -> tuple[str, str]:
    """Return kind and name of what a call calls."""
    if isinstance(node.func, ast.Name):
        if node.func.id in local:
            return "local", node.func.id
        return known.kind(node.func.id)
    if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
        owner = node.func.value.id
        if owner not in local and known.kind(owner)[0] == "module":
            return "math", node.func.attr
        return "other", f"{owner}.{node.func.attr}"
    return "other", re.sub(r"\s+", " ", ast.unparse(node.func))
