"""Two faults that Python accepts: a result of the wrong length, a division by a slip of zero."""

from __future__ import annotations

import ast

_XDOT = 7  # position of the slip velocity among the parameters


def wrong_lengths(function: ast.FunctionDef, with_state: bool = False) -> list[tuple[int, str]]:
    """Return where lists of another length than three are returned, or with a state beside."""
    returned = [
        node.value for node in ast.walk(function) if isinstance(node, ast.Return) and node.value
    ]
    if with_state:
        returned = [pair.elts[0] for pair in returned if isinstance(pair, ast.Tuple) and pair.elts]
    names = {value.id for value in returned if isinstance(value, ast.Name)}
    grown = {
        node.func.value.id
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
    }  # fmt: skip
    lists: list[ast.expr] = list(returned)
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target = node.targets[0]
            if isinstance(target, ast.Name) and target.id in names - grown:
                lists.append(node.value)
    return [
        (node.lineno, f"a list of {len(node.elts)}, but the result has 3 entries [Fx, Fy, Tz]")
        for node in lists
        if isinstance(node, (ast.List, ast.Tuple)) and len(node.elts) != 3
    ]


def unguarded_divisions(function: ast.FunctionDef) -> list[tuple[int, str]]:
    """Return where the slip speed divides on a path that v = 0 can take."""
    every = [*function.args.posonlyargs, *function.args.args]
    if len(every) <= _XDOT:
        return []
    speeds = _speeds(function, every[_XDOT].arg)
    found: list[tuple[int, str]] = []
    _block(function.body, speeds, set(), found)
    return found


def _names(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _speeds(function: ast.FunctionDef, xdot: str) -> set[str]:
    """Return the names whose every value is the root of squared slip velocities."""
    derived, values = {xdot}, dict[str, list[ast.expr]]()
    for _ in range(2):
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and len(node.targets) == 1:
                target = node.targets[0]
                if isinstance(target, ast.Name):
                    values.setdefault(target.id, []).append(node.value)
                if _names(node.value) & derived and not isinstance(target, ast.Subscript):
                    derived |= _names(target)
    return {
        name for name, found in values.items()
        if all(_is_root(value, derived) for value in found)
    }  # fmt: skip


def _is_root(value: ast.expr, derived: set[str]) -> bool:
    """Return whether an expression is sqrt(...), hypot(...) or (...)**0.5 of slip alone."""
    if isinstance(value, ast.Call):
        name = getattr(value.func, "attr", getattr(value.func, "id", ""))
        inside = list(value.args) if name in ("sqrt", "hypot") else []
    elif isinstance(value, ast.BinOp) and isinstance(value.op, ast.Pow):
        half = isinstance(value.right, ast.Constant) and value.right.value == 0.5
        inside = [value.left] if half else []
    else:
        return False
    # sqrt(vx*vx + eps) is not zero at rest: every term must be of slip
    terms = list(inside)
    while any(isinstance(term, ast.BinOp) and isinstance(term.op, ast.Add) for term in terms):
        terms = [
            part
            for term in terms
            for part in (
                (term.left, term.right)
                if isinstance(term, ast.BinOp) and isinstance(term.op, ast.Add)
                else (term,)
            )
        ]
    return bool(terms) and all(_names(term) & derived for term in terms)


def _away(test: ast.expr, holds: bool) -> set[str]:
    """Return the names that are not zero where `test` holds (or does not)."""
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        return _away(test.operand, not holds)
    if isinstance(test, ast.BoolOp):
        parts = [_away(value, holds) for value in test.values]
        # both sides are known of `a and b` that holds, and of `a or b` that does not
        known = isinstance(test.op, ast.And) == holds
        return set.union(*parts) if known else set.intersection(*parts)
    if isinstance(test, ast.Name):
        return {test.id} if holds else set()
    if isinstance(test, ast.Compare) and len(test.ops) == 1:
        left, op, right = test.left, test.ops[0], test.comparators[0]
        flipped = {ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE}
        if isinstance(right, ast.Name) and not isinstance(left, ast.Name):
            left, right, op = right, left, flipped.get(type(op), type(op))()
        if not isinstance(left, ast.Name):
            return set()
        opposite = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt,
                    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}  # fmt: skip
        kind = type(op) if holds else opposite.get(type(op))
        zero = isinstance(right, ast.Constant) and right.value == 0
        # thresholds are taken as positive: a transition velocity of 0 is another fault
        if kind in (ast.Gt, ast.NotEq) or (kind is ast.GtE and not zero):
            return {left.id} if kind is not ast.NotEq or zero else set()
        if kind in (ast.LtE, ast.Lt) and isinstance(right, ast.Name):
            return {right.id} if kind is ast.Lt else set()
    return set()


def _block(
    body: list[ast.stmt], speeds: set[str], safe: set[str], found: list[tuple[int, str]]
) -> None:
    """Collect the unguarded divisions of a block; `safe` are the names known not to be zero."""
    safe = set(safe)
    for statement in body:
        if isinstance(statement, (ast.If, ast.While)):
            _expression(statement.test, speeds, safe, found)
            _block(statement.body, speeds, safe | _away(statement.test, True), found)
            _block(statement.orelse, speeds, safe | _away(statement.test, False), found)
            last = statement.body[-1]
            if isinstance(statement, ast.If) and isinstance(last, (ast.Return, ast.Raise)):
                safe |= _away(statement.test, False)
        elif isinstance(statement, ast.For):
            _block(statement.body, speeds, safe, found)
        elif isinstance(statement, (ast.Try, ast.With)):
            # a division inside try may be meant to fail
            continue
        else:
            _expression(statement, speeds, safe, found)


def _expression(
    root: ast.AST, speeds: set[str], safe: set[str], found: list[tuple[int, str]]
) -> None:
    if isinstance(root, ast.IfExp):
        _expression(root.test, speeds, safe, found)
        _expression(root.body, speeds, safe | _away(root.test, True), found)
        _expression(root.orelse, speeds, safe | _away(root.test, False), found)
        return
    if isinstance(root, ast.BinOp) and isinstance(root.op, ast.Div):
        divisor = root.right
        if isinstance(divisor, ast.Name) and divisor.id in speeds - safe:
            found.append(
                (divisor.lineno, f"divides by the slip speed {divisor.id}, which fails at "
                 f"{divisor.id} = 0, a body at rest")
            )  # fmt: skip
    for child in ast.iter_child_nodes(root):
        _expression(child, speeds, safe, found)
