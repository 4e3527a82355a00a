"""The grid as a PDDL+ domain and problem, and the planner that solves it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from typing import Any

from .grid import Cell, GridProblem, beside

TIMEOUT_S = 10.0
"""The planner itself gives up then, s: after the team's own deadline, so that every miss is counted there."""
SEARCH = "novelty"
"""One search: the planner's own choice shares out wall time among several, and plans otherwise on a busy machine."""
DOMAIN = """
(define (domain capture-the-flag)
  (:requirements :strips :typing :negative-preconditions :time)
  (:types cell)
  (:predicates (at ?c - cell) (next ?a ?b - cell) (flag ?c - cell) (watched ?c - cell) (own ?c - cell)
               (carrying) (tagged) (captured))
  (:action move
    :parameters (?a ?b - cell)
    :precondition (and (at ?a) (next ?a ?b) (not (tagged)))
    :effect (and (not (at ?a)) (at ?b)))
  (:event grab
    :parameters (?c - cell)
    :precondition (and (at ?c) (flag ?c) (not (carrying)) (not (tagged)))
    :effect (carrying))
  (:event contact
    :parameters (?c - cell)
    :precondition (and (at ?c) (watched ?c) (not (tagged)))
    :effect (tagged))
  (:event capture
    :parameters (?c - cell)
    :precondition (and (at ?c) (own ?c) (carrying) (not (tagged)) (not (captured)))
    :effect (captured)))
"""
_MOVE = re.compile(r"\(move \S+ c(\d+)-(\d+)\)")


def available() -> bool:
    """Whether the planner is installed."""
    return find_spec("kairos") is not None


def problem_text(problem: GridProblem) -> str:
    """The PDDL+ problem of the cells that matter; watched ones among them are there and make contact."""
    cells = cells_of(problem)
    known = set(cells)
    facts = [f"(at {_name(problem.start)})", *(["(carrying)"] if problem.carrying else [])]
    # nobody gains by moving off a watched cell, where contact ends the plan
    facts += [
        f"(next {_name(cell)} {_name(to)})"
        for cell in cells
        if cell not in problem.watched
        for to in beside(cell)
        if to in known
    ]
    facts += _about("flag", problem.flag & known) + _about("watched", problem.watched & known)
    facts += _about("own", [cell for cell in cells if cell[0] < problem.own])
    names = " ".join(map(_name, cells))
    init = " ".join(facts)
    return (
        f"(define (problem now) (:domain capture-the-flag) (:objects {names} - cell) (:init {init}) (:goal (captured)))"
    )


def cells_of(problem: GridProblem) -> list[Cell]:
    """What can be reached without contact, the watched cells beside it, and no more of the own zone than a way needs.

    The planner's time goes with the number of cells. A shortest way never turns back by more than a column in the own
    zone, where only mates stand in it.
    """
    first = min(problem.start[0], problem.own - 1) - 1
    seen, edge = {problem.start}, [problem.start]
    while edge:
        found = {to for cell in edge for to in beside(cell) if to[0] >= first and problem.open_to(to)} - seen
        seen |= found
        edge = list(found)
    contacts = {to for cell in seen for to in beside(cell) if to in problem.watched}
    return sorted(seen | contacts)


def plan(problem: GridProblem, timeout_s: float = TIMEOUT_S) -> list[Cell] | None:
    """Cells to move through to a capture; None where the planner finds no plan. Needs the extra ``[plan]``."""
    kairos, domain = _planner()
    parsed = kairos.parse_problem(problem_text(problem), domain)
    result = kairos.Planner().solve(parsed, timeout=timeout_s, anytime=False, search=SEARCH)
    if result.status != kairos.Status.SOLVED:
        return None
    return [(int(column), int(row)) for column, row in _MOVE.findall(str(result.plan))]


@cache
def _planner() -> tuple[Any, Any]:
    import kairos  # the extra [plan]

    return kairos, kairos.parse_domain(DOMAIN)


def _about(predicate: str, cells: Iterable[Cell]) -> list[str]:
    return [f"({predicate} {_name(cell)})" for cell in sorted(cells)]


def _name(cell: Cell) -> str:
    return f"c{cell[0]}-{cell[1]}"
