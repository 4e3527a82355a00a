"""Small functions written where they are called: in plain Python a call costs more than what most of them do.

Only functions that are a chain of ``if ...: return ...`` and a last ``return``, such as `usv.clamp`, and the built-in
``min`` and ``max`` of two. What is handed to them is worked out once, where it is needed first.
"""

from __future__ import annotations

import ast
import copy
from dataclasses import dataclass


@dataclass(frozen=True)
class Small:
    """A function that is one expression.

    Attributes:
        parameters: their names.
        expression: what it returns.
    """

    parameters: tuple[str, ...]
    expression: ast.expr


LESSER = Small(("a", "b"), ast.parse("b if b < a else a", mode="eval").body)
GREATER = Small(("a", "b"), ast.parse("b if b > a else a", mode="eval").body)


def small(function: ast.FunctionDef) -> Small | None:
    """A function as one expression; None where it is none, or works with anything but numbers it is handed."""
    *tests, last = function.body
    parameters = tuple(one.arg for one in function.args.args)
    if not isinstance(last, ast.Return) or last.value is None or isinstance(last.value, ast.Tuple):
        return None
    expression = last.value
    for one in reversed(tests):
        if not isinstance(one, ast.If) or one.orelse or len(one.body) != 1:
            return None
        returned = one.body[0]
        if not isinstance(returned, ast.Return) or returned.value is None:
            return None
        expression = ast.IfExp(one.test, returned.value, expression)
    names = {one.id for one in ast.walk(expression) if isinstance(one, ast.Name)}
    simple = all(isinstance(one, _SIMPLE) for one in ast.walk(expression))
    return Small(parameters, expression) if names <= set(parameters) and simple else None


_SIMPLE = (ast.IfExp, ast.Compare, ast.BinOp, ast.UnaryOp, ast.Name, ast.Constant, ast.Load, ast.operator, ast.cmpop)
_SIMPLE += (ast.unaryop,)  # type: ignore[assignment]


class Inliner:
    """Writes small functions out.

    Args:
        prefix: of the names for what is worked out once.
    """

    def __init__(self, prefix: str) -> None:
        self._prefix, self._count = prefix, 0

    def written_out(self, of: Small, arguments: list[ast.expr]) -> ast.expr | None:
        """The call as an expression; None where something would not be worked out before it is used."""
        given: dict[str, ast.expr] = {}
        for name, argument in zip(of.parameters, arguments, strict=True):
            at_hand = isinstance(argument, (ast.Name, ast.Constant)) or _uses(name, of.expression) <= 1
            if not at_hand and not _first_in_test(name, of.expression):
                return None
            given[name] = argument
        return _Filled(given, self).visit(copy.deepcopy(of.expression))

    def name(self) -> str:
        """A new name."""
        self._count += 1
        return f"{self._prefix}_{self._count}"


def _uses(name: str, expression: ast.expr) -> int:
    return sum(isinstance(one, ast.Name) and one.id == name for one in ast.walk(expression))


def _first_in_test(name: str, expression: ast.expr) -> bool:
    """Whether the first test of a chain that uses a name comes before whatever else uses it."""
    while isinstance(expression, ast.IfExp):
        if _uses(name, expression.test):
            return True
        if _uses(name, expression.body):
            return False
        expression = expression.orelse
    return _uses(name, expression) <= 1


class _Filled(ast.NodeTransformer):
    """Puts arguments in the places of parameters: worked out at the first, by name at the others."""

    def __init__(self, given: dict[str, ast.expr], inliner: Inliner) -> None:
        self._given, self._inliner = given, inliner

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        node.test = self.visit(node.test)  # the order in which they are worked out
        node.body, node.orelse = self.visit(node.body), self.visit(node.orelse)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        argument = self._given.get(node.id)
        if argument is None:
            return node
        if not isinstance(argument, (ast.Name, ast.Constant)):
            name = self._inliner.name()
            self._given[node.id] = ast.Name(name, ast.Load())
            return ast.NamedExpr(ast.Name(name, ast.Store()), argument)
        return copy.deepcopy(argument)
