"""A user's function, rewritten so that compiled code does what Python does.

The traps: a list of integers stays one when floats are stored into it (every force is then
silently 0), `math` functions give nan where Python raises, helpers return lists of mixed
type, and the time of `py_getstm` is no argument, nor is the area of `py_get_contact_area`.
"""

from __future__ import annotations

import ast
import copy
import math
from typing import Any

from mbsim.plugins.compile.whitelist import (
    MATH_CHECKED,
    MATH_CONSTANTS,
    Globals,
    callee,
    local_names,
)

_HEADER = (
    "# written by mbsim from a user's script; do not edit\n"
    "import math as mbsim_math\n"
    "from mbsim.plugins.kernels import {names}\n"
)


def rewritten(order: list[str], known: Globals, count: int = 11) -> str:
    """Return the text of a module with the functions of `order`; the last is the subroutine.

    `count` is how many arguments the subroutine is called with, as documented.
    """
    used: set[str] = set()
    parts = []
    for position, name in enumerate(order):
        function = copy.deepcopy(known.functions[name])
        rewrite = _Rewrite(known, local_names(function), used)
        parts.append(rewrite.function(function, count if position == len(order) - 1 else 0))
    lines = [f"{name} = {_literal(known.constants[name])}" for name in sorted(known.constants)]
    names = ", ".join(sorted(used | {"mbsim_sqrt"}))
    return "\n".join([_HEADER.format(names=names), *lines, "", *parts, ""])


def _literal(value: Any) -> str:
    """Return a number or a tuple of numbers as source text."""
    if isinstance(value, tuple):
        return "(" + "".join(_literal(part) + ", " for part in value) + ")"
    if isinstance(value, (bool, int)):
        return repr(value)
    number = float(value)  # numpy's float64 prints its type
    return repr(number) if math.isfinite(number) else f"float({str(number)!r})"


class _Rewrite(ast.NodeTransformer):
    """The rewriting of one function; collects the kernels it comes to use."""

    def __init__(self, known: Globals, local: set[str], used: set[str]) -> None:
        self.known, self.local, self.used = known, local, used

    def function(self, node: ast.FunctionDef, documented: int) -> str:
        """Return the text of the rewritten function; the subroutine's has documented arguments."""
        args = node.args
        for arg in (*args.posonlyargs, *args.args):
            arg.annotation = None
        if ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
        if documented:
            # parameters beyond the documented ones keep their defaults; then come time and area
            every = [*args.posonlyargs, *args.args]
            count = len(every) - len(args.defaults)
            extra = [
                ast.Assign([ast.Name(arg.arg, ast.Store())], args.defaults[position - count])
                for position, arg in enumerate(every)
                if position >= documented
            ]
            args.posonlyargs, args.defaults = [], []
            args.args = [*every[:documented], ast.arg("mbsim_now"), ast.arg("mbsim_area")]
            node.body = [*extra, *node.body]
        node.returns = None
        node.body = [self.visit(statement) for statement in node.body] or [ast.Pass()]
        return ast.unparse(ast.fix_missing_locations(node))

    def kernel(self, name: str, *args: ast.expr) -> ast.Call:
        self.used.add(name)
        return ast.Call(ast.Name(name, ast.Load()), list(args), [])

    def as_float(self, node: ast.expr) -> ast.expr:
        """Return a float in place of a number, constant or not; displays keep their kind."""
        if isinstance(node, (ast.List, ast.Tuple, ast.ListComp)):
            return node
        if isinstance(node, ast.Constant):
            return ast.Constant(float(node.value))  # type: ignore[arg-type]
        return ast.Call(ast.Name("float", ast.Load()), [node], [])

    def visit_List(self, node: ast.List) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.ctx, ast.Load):
            node.elts = [self.as_float(element) for element in node.elts]
        return node

    def as_loop(self, node: ast.expr) -> ast.expr:
        """Return what a loop runs over: `for i in [0, 1]` counts, its integers stay."""
        if isinstance(node, ast.List):
            return ast.Tuple([self.visit(element) for element in node.elts], ast.Load())
        return self.visit(node)  # type: ignore[no-any-return]

    def visit_For(self, node: ast.For) -> ast.For:
        node.iter = self.as_loop(node.iter)
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_ListComp(self, node: ast.ListComp) -> ast.ListComp:
        loop = node.generators[0]
        loop.iter = self.as_loop(loop.iter)
        loop.ifs = [self.visit(test) for test in loop.ifs]
        node.elt = self.as_float(self.visit(node.elt))
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt:
        self.generic_visit(node)
        assert node.value is not None
        return ast.Assign([node.target], node.value)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            return self.power(node.left, node.right)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            value = copy.deepcopy(node.target)
            value.ctx = ast.Load()
            return ast.Assign([node.target], self.power(value, node.value))
        return node

    def power(self, base: ast.expr, exponent: ast.expr) -> ast.expr:
        # x**2 cannot fail short of overflow, and compiles to a product
        fixed = isinstance(exponent, ast.Constant) and exponent.value in (1, 2)
        if fixed and isinstance(exponent.value, int):  # type: ignore[attr-defined]
            return ast.BinOp(base, ast.Pow(), exponent)
        return self.kernel("mbsim_power", base, exponent)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if isinstance(node.ctx, ast.Load) and node.id not in self.local:
            kind, name = self.known.kind(node.id)
            if kind == "math" and name in MATH_CONSTANTS:
                return self.math(name)
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        # the whitelist lets no other attribute through than math's constants and append
        return self.math(node.attr) if node.attr != "append" else node

    def math(self, name: str) -> ast.Attribute:
        return ast.Attribute(ast.Name("mbsim_math", ast.Load()), name, ast.Load())

    def visit_Call(self, node: ast.Call) -> ast.expr:
        kind, name = callee(node, self.known, self.local)
        args = [self.visit(arg) for arg in node.args]
        if isinstance(node.func, ast.Attribute) and node.func.attr == "append":
            return ast.Call(node.func, [self.as_float(args[0])], [])
        if kind == "math":
            if name in MATH_CHECKED:
                return self.kernel("mbsim_power" if name == "pow" else f"mbsim_{name}", *args)
            return ast.Call(self.math(name), args, [])
        if kind == "helper":
            if name in ("py_step", "py_step5"):
                return self.kernel("mbsim_" + name[3:], *args)
            return ast.Name("mbsim_now" if name == "py_getstm" else "mbsim_area", ast.Load())
        if kind == "builtin" and name == "int" and len(args) == 1:
            return self.kernel("mbsim_int", *args)
        return ast.Call(node.func, args, [])

    def visit_Expr(self, node: ast.Expr) -> ast.stmt:
        call = node.value
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
            if self.known.is_espy(call.func.id, self.local):
                return ast.Pass()
            if call.func.id == "py_errmes":
                error = ast.Call(ast.Name("ValueError", ast.Load()), [ast.Constant("stop")], [])
                return ast.If(self.visit(call.args[0]), [ast.Raise(error, None)], [])
        if isinstance(call, ast.Constant):
            return ast.Pass()
        self.generic_visit(node)
        return node

    def visit_Return(self, node: ast.Return) -> ast.Return:
        self.generic_visit(node)
        # force and new state: tuples of numbers of one kind
        for part in node.value.elts if isinstance(node.value, ast.Tuple) else ():
            if isinstance(part, ast.Tuple):
                part.elts = [self.as_float(element) for element in part.elts]
        return node

    def visit_Raise(self, node: ast.Raise) -> ast.Raise:
        # the message may be anything; the interpreted function will give it
        call = node.exc if not isinstance(node.exc, ast.Call) else node.exc.func
        node.exc = ast.Call(call, [ast.Constant("raised")], []) if call else None
        return node
