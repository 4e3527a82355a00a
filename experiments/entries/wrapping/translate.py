"""The shield's compiled functions as plain Python: the same statements, written so that they run fast on lists.

    a[i, j]          ->  a[i][j]             rows are lists, and stay the same objects
    a[i, :] = x      ->  fill(a[i], x)
    a.shape[0]       ->  len(a)
    L.SPEED, FAR     ->  their values
    a / b            ->  a / b if b else by_zero(a)
    math.sqrt(x)     ->  math_sqrt(x)
    f(x)             ->  plain_f(x)          of a compiled function f, on lists
    clamp(x, a, b)   ->  b if x > b else ... of those that are short, see `inline`

A function f that was compiled is there twice: as ``plain_f``, for its like, and as ``f``, for those who have arrays.
The order of operations is left as it is, and so are the results, bit for bit where the compiler did the same.
"""

from __future__ import annotations

import ast
import math
from types import ModuleType
from typing import Any

from .inline import GREATER, LESSER, Inliner, Small, small
from .sources import SHIELD, STAND_INS, Source

DECORATORS = {"kernel", "lean_kernel"}
ON_ARRAYS = {f"{SHIELD}.filter.active_set"}
"""Modules whose compiled functions are given arrays, and run on them as they are."""
PLAIN = "plain_"
HELPERS = ("fill", "put", "by_zero", "entered")
IN_NUMPY = {"np.fmod": "math_fmod", "np.float64": "float"}
"""Functions of numpy that compiled code uses, and what does the same for a number."""


def compiled_names(tree: ast.Module) -> set[str]:
    """Names of the functions of a module that are compiled."""
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and _is_compiled(node)}


def _is_compiled(node: ast.FunctionDef) -> bool:
    return any(isinstance(one, ast.Name) and one.id in DECORATORS for one in node.decorator_list)


def small_functions(tree: ast.Module) -> dict[str, Small]:
    """The compiled functions of a module that are written out where they are called."""
    _drop_words(tree)
    found = {node.name: small(node) for node in tree.body if isinstance(node, ast.FunctionDef) and _is_compiled(node)}
    return {name: one for name, one in found.items() if one is not None}


def translate(source: Source, compiled: dict[str, set[str]], short: dict[str, dict[str, Small]]) -> str:
    """The plain source of a module.

    Args:
        source: the module.
        compiled: names of compiled functions by full name of their module.
        short: the same of those that are written out.
    """
    tree = ast.parse(source.path.read_text())
    _drop_words(tree)
    known, written = set(compiled.get(source.name, ())), dict(short.get(source.name, {}))
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level:
            of = {one.name for one in node.names} & compiled.get(source.imports(node), set())
            node.names = [one for one in node.names if one.name not in DECORATORS]
            node.names += [ast.alias(f"{PLAIN}{name}") for name in sorted(of)]
            known |= of
            written |= {name: one for name, one in short.get(source.imports(node), {}).items() if name in of}
    if source.name in ON_ARRAYS:
        body = [part for node in tree.body for part in _as_it_is(node)]
    else:
        module = source.module()
        body = [part for node in tree.body for part in _on_lists(node, module, known, written)]
    tree.body = _with_helpers([node for node in body if not _is_empty(node)], source, bool(known))
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def _drop_words(tree: ast.Module) -> None:
    """Drop docstrings: they are in the package's own sources."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]


def _is_empty(node: ast.stmt) -> bool:
    return isinstance(node, ast.ImportFrom) and not node.names


def _as_it_is(node: ast.stmt) -> list[ast.stmt]:
    if not isinstance(node, ast.FunctionDef) or not _is_compiled(node):
        return [node]
    node.decorator_list = []
    return [node, *ast.parse(f"{PLAIN}{node.name} = {node.name}").body]


def _on_lists(node: ast.stmt, module: ModuleType, known: set[str], short: dict[str, Small]) -> list[ast.stmt]:
    if not isinstance(node, ast.FunctionDef) or not _is_compiled(node):
        return [node]
    name, node.name, node.decorator_list, node.returns = node.name, f"{PLAIN}{node.name}", [], None
    for argument in node.args.args:
        argument.annotation = None
    _Function(node, module, known, short).visit(node)
    return [node, *ast.parse(f"{name} = entered({PLAIN}{name})").body]


def _with_helpers(body: list[ast.stmt], source: Source, needed: bool) -> list[ast.stmt]:
    """The statements of a module after what compiled functions need, which goes below imports of the future."""
    if not needed or source.name in ON_ARRAYS or source.name in STAND_INS:
        return body
    names = ", ".join(f"{name} as math_{name}" for name in dir(math) if not name.startswith("_"))
    up = "." * (source.inside.count("/") + int(source.is_package))
    helpers = ast.parse(f"from math import {names}\nfrom {up}jit import {', '.join(HELPERS)}\nnan = math_nan").body
    first = next((k for k, node in enumerate(body) if getattr(node, "module", "") != "__future__"), len(body))
    return [*body[:first], *helpers, *body[first:]]


class _Function(ast.NodeTransformer):
    """Rewrites the body of one compiled function."""

    def __init__(self, function: ast.FunctionDef, module: ModuleType, known: set[str], short: dict[str, Small]) -> None:
        self._module, self._known, self._temporaries = module, known, 0
        self._short, self._inliner = {"min": LESSER, "max": GREATER, **short}, Inliner("of")
        names = {one.arg for one in function.args.args}
        self._local = names | {
            one.id for one in ast.walk(function) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)
        }

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if not isinstance(node.ctx, ast.Load) or node.id in self._local:
            return node
        if node.id in self._known:
            return ast.Name(f"{PLAIN}{node.id}", ast.Load())
        return self._constant(getattr(self._module, node.id, None), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        text = ast.unparse(node)
        if text in IN_NUMPY:
            return ast.Name(IN_NUMPY[text], ast.Load())
        if isinstance(node.value, ast.Name) and node.value.id not in self._local:
            of = getattr(self._module, node.value.id, None)
            if isinstance(of, ModuleType) and isinstance(node.ctx, ast.Load):
                value = getattr(of, node.attr, None)
                if callable(value) and of is math:
                    return ast.Name(f"math_{node.attr}", ast.Load())
                return self._constant(value, node)
        return self.generic_visit(node)  # type: ignore[return-value]

    def _constant(self, value: Any, node: ast.expr) -> ast.expr:
        if type(value) is float and math.isnan(value):
            return ast.Name("math_nan", ast.Load())
        return ast.Constant(value) if type(value) in (int, float) else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        if _shape_of(node.value) is not None and isinstance(node.slice, ast.Constant):
            of = self.visit(_shape_of(node.value))
            for _ in range(node.slice.value):
                of = ast.Subscript(of, ast.Constant(0), ast.Load())
            return ast.Call(ast.Name("len", ast.Load()), [of], [])
        self.generic_visit(node)
        if not isinstance(node.slice, ast.Tuple) or any(isinstance(one, ast.Slice) for one in node.slice.elts[:-1]):
            return node
        value = node.value
        for one in node.slice.elts[:-1]:
            value = ast.Subscript(value, one, ast.Load())
        return ast.Subscript(value, node.slice.elts[-1], node.ctx)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        of = self._short.get(node.func.id) if isinstance(node.func, ast.Name) else None
        self.generic_visit(node)
        if of is None or len(node.args) != len(of.parameters) or node.keywords:
            return node
        return self._inliner.written_out(of, node.args) or node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        return self._quotient(node.left, node.right) if isinstance(node.op, ast.Div) else node

    def _quotient(self, over: ast.expr, under: ast.expr) -> ast.expr:
        if isinstance(under, ast.Constant) and under.value:
            return ast.BinOp(over, ast.Div(), under)
        test = under
        if not isinstance(under, ast.Name):
            self._temporaries += 1
            name = f"under_{self._temporaries}"
            test, under = ast.NamedExpr(ast.Name(name, ast.Store()), under), ast.Name(name, ast.Load())
        wrong = ast.Call(ast.Name("by_zero", ast.Load()), [over], [])
        return ast.IfExp(test, ast.BinOp(over, ast.Div(), under), wrong)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        self.generic_visit(node)
        if isinstance(node.op, ast.Div):
            over = ast.parse(ast.unparse(node.target), mode="eval").body
            return ast.Assign([node.target], self._quotient(over, node.value))
        return node

    def visit_Assign(self, node: ast.Assign) -> Any:
        target = node.targets[0]
        if not _has_slice(target):
            return self.generic_visit(node)
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            self._temporaries += 1
            names = [f"value_{self._temporaries}_{k}" for k in range(len(target.elts))]
            parts: list[ast.stmt] = [
                ast.Assign([ast.Name(name, ast.Store())], value)
                for name, value in zip(names, node.value.elts, strict=True)
            ]
            parts += [
                ast.Assign([one], ast.Name(name, ast.Load())) for name, one in zip(names, target.elts, strict=True)
            ]
            self._local |= set(names)
            return [self.visit(part) for part in parts]
        assert isinstance(target, ast.Subscript)
        return self._slice_assigned(target, self.visit(node.value))

    def _slice_assigned(self, target: ast.Subscript, value: ast.expr) -> ast.stmt:
        places = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
        whole = all(not isinstance(one, ast.Slice) or (one.lower is one.upper is None) for one in places)
        base = self.visit(target.value)
        if not whole:  # a part of an array of the program
            return ast.Assign([ast.Subscript(base, self.visit(target.slice), ast.Store())], value)
        nothing = ast.Constant(None)
        given = [nothing if isinstance(one, ast.Slice) else self.visit(one) for one in places]
        if isinstance(places[-1], ast.Slice) and not any(isinstance(one, ast.Slice) for one in places[:-1]):
            for one in given[:-1]:
                base = ast.Subscript(base, one, ast.Load())
            return ast.Expr(ast.Call(ast.Name("fill", ast.Load()), [base, value], []))
        return ast.Expr(ast.Call(ast.Name("put", ast.Load()), [base, ast.Tuple(given, ast.Load()), value], []))


def _shape_of(node: ast.expr) -> ast.expr | None:
    """What the shape is taken of, where an expression is a shape."""
    return node.value if isinstance(node, ast.Attribute) and node.attr == "shape" else None


def _has_slice(target: ast.expr) -> bool:
    if isinstance(target, ast.Tuple):
        return any(_has_slice(one) for one in target.elts)
    if not isinstance(target, ast.Subscript):
        return False
    places = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
    return any(isinstance(one, ast.Slice) for one in places)
