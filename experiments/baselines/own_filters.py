"""Filters and barriers of a user's own: what they have to be and to give, checked where they are asked."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from steerclear.shield.arrays import say_once
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.jit import Array

Jet = tuple[Array, Array, Array]
"""h, and its gradients in p and in what the inputs act on: v, or p if the inputs are velocities."""
MAKER = "make_filter(config, games, platforms, team, surroundings)"
HAS = "decide(state, nominal, ours), reason and safety_margin_m"
REASONS = np.iinfo(np.int8)
"""Codes that a trajectory can hold."""


def refused_call(function: Callable[..., Any], *args: Any) -> str:
    """Return why a function does not take these arguments, in Python's words; empty where it does."""
    try:
        inspect.signature(function).bind(*args)
    except TypeError as fault:
        return str(fault)
    except ValueError:  # compiled, with no signature to look at
        return ""
    return ""


def name_of(thing: object) -> str:
    """Return what a function, class or object is called in messages."""
    return str(getattr(thing, "__qualname__", "") or type(thing).__name__)


def is_filter(thing: object) -> bool:
    """Return whether something is a filter itself, not a class or function that makes one."""
    return hasattr(thing, "decide") and not isinstance(thing, type)


def check_maker(maker: object) -> None:
    """Refuse (ConfigError) what is neither a filter's name nor makes one."""
    if isinstance(maker, str) or (callable(maker) and not is_filter(maker)):
        return
    found, hint = name_of(maker), ""
    if is_filter(maker):
        found, hint = f"{found}, a filter itself", "; give a function that makes one for each batch of games"
    raise ConfigError(f"the safety filter is {found}; expected a filter's name or {MAKER}{hint}")


def made_filter(maker: Callable[..., Any], fleet: Sequence[Any]) -> Any:
    """Return the filter that a maker makes.

    Args:
        maker: what makes a filter from ``fleet``.
        fleet: config, games, platforms, team, surroundings.

    Raises:
        ConfigError: it takes other arguments, or makes no filter.
    """
    if why := refused_call(maker, *fleet):
        hint = f"; give lambda *fleet: {name_of(maker)}(...)" if isinstance(maker, type) else ""
        raise ConfigError(f"{name_of(maker)} cannot be called as {MAKER}: {why}{hint}")
    made = maker(*fleet)
    if not is_filter(made) or not callable(made.decide):
        found = f"the class {name_of(made)}" if isinstance(made, type) else name_of(made)
        raise ConfigError(f"{name_of(maker)} made {found}; expected an object with {HAS}")
    return made


def check_decide(safety_filter: Any) -> None:
    """Refuse (ConfigError) a filter whose ``decide`` takes other arguments."""
    if why := refused_call(safety_filter.decide, None, None, None):
        raise ConfigError(f"{name_of(safety_filter)}.decide cannot be called as decide(state, nominal, ours): {why}")


def check_answer(safety_filter: Any, answer: object, shape: tuple[int, int]) -> Array:
    """Return the commands (games, boats, 2) that a filter decided.

    Raises:
        FleetError: they are none.
    """
    return _numbers(answer, f"{name_of(safety_filter)}.decide returned", (*shape, 2), "speed m/s and heading deg")


def check_account(safety_filter: Any, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Return reason and margin (games, boats) of a filter's last decision.

    Raises:
        ConfigError: it has none.
        FleetError: they are of another shape, or no such numbers.
    """
    who = name_of(safety_filter)
    if missing := [name for name in ("reason", "safety_margin_m") if not hasattr(safety_filter, name)]:
        raise ConfigError(
            f"the safety filter {who} has no {' and no '.join(missing)} after decide(...); give "
            "both, (games, boats), as baselines.registry.NoFilter does"
        )
    reason = _numbers(safety_filter.reason, f"{who}.reason is", shape, "codes of Reason")
    margin_m = _numbers(safety_filter.safety_margin_m, f"{who}.safety_margin_m is", shape, "m")
    if not ((reason >= REASONS.min) & (reason <= REASONS.max) & (reason == np.round(reason))).all():
        raise FleetError(f"{who}.reason holds what is no code; give whole numbers, those of Reason")
    return reason, margin_m


def check_jet(
    jet: Callable[..., Any], p: Array, v: Array, radius_m: float, gains: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Return h and its gradients in p and in v, as a barrier's function gives them.

    Args:
        jet: the function.
        p: (2, ...) relative places, m.
        v: (2, ...) relative velocities, m/s.
        radius_m: required distance, m.
        gains: further gains, each of the shape of h.

    Raises:
        ConfigError: it takes other arguments, or gives something else.
    """
    who, names = name_of(jet), ", ".join(["p", "v", "radius_m", *(f"gain_{k + 2}" for k in range(len(gains)))])
    if why := refused_call(jet, p, v, radius_m, *gains):
        raise ConfigError(
            f"the barrier's function {who} cannot be called as {who}({names}): {why}; "
            "it receives each gain of tried but the first, which is alpha"
        )
    given: Any = jet(p, v, radius_m, *gains)
    expected = f"expected three arrays: h {p.shape[1:]}, its gradients in p and in v {p.shape}"
    if not isinstance(given, tuple | list):
        raise ConfigError(f"the barrier's function {who} returned {_shape_words(given)}; {expected}")
    shapes = [_shape_words(one) for one in given]
    if [_shape_of(one) for one in given] != [p.shape[1:], p.shape, p.shape]:
        raise ConfigError(f"the barrier's function {who} returned {', '.join(shapes) or 'nothing'}; {expected}")
    h, h_p, h_v = map(np.asarray, given)
    _hint_at_no_numbers(who, p, h, h_p, h_v)
    return h, h_p, h_v


def _hint_at_no_numbers(who: str, p: Array, h: Array, h_p: Array, h_v: Array) -> None:
    """Warn once of a barrier without a value, or with an endless gradient, of two different boats."""
    unknown = np.isnan(h) | ~np.isfinite(h_p).all(axis=0) | ~np.isfinite(h_v).all(axis=0)
    if p.ndim == 4:
        unknown = unknown & ~np.eye(p.shape[-1], dtype=np.bool_)  # of a boat and itself nothing is asked
    if unknown.any():
        east_m, north_m = (float(part[unknown][0]) for part in p)
        say_once(
            f"no number of {who}",
            f"the barrier's function {who} returned what is no number (h or a gradient) for p = ({east_m:.3g}, "
            f"{north_m:.3g}) m, and boats stop there; give numbers everywhere: bound roots and divisors from below, as "
            "`tangent` in baselines.barriers does",
        )


def check_gains(gains: Any, what: str, count: int | None = None) -> None:
    """Refuse (ConfigError) what is no sequence of positive numbers; ``count``: of as many."""
    such_as = "(0.5,)" if count in (None, 1) else f"{count} numbers"
    is_list = isinstance(gains, tuple | list)
    if not is_list or not gains or not all(_is_gain(one) for one in gains):
        raise ConfigError(f"{what} is {gains!r}; give numbers of at least 0 as {such_as}, alpha (1/s) the first")
    if count is not None and len(gains) != count:
        raise ConfigError(f"{what} is {gains!r}, {len(gains)} gains where others are {count}; give as many everywhere")


def _is_gain(value: Any) -> bool:
    is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return is_number and bool(np.isfinite(value)) and value >= 0


def _numbers(value: Any, said: str, shape: tuple[int, ...], unit: str) -> Array:
    if _shape_of(value) != shape:
        raise FleetError(f"{said} {_shape_words(value)}; expected an array {shape}, {unit}")
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise FleetError(f"{said} an array of what is no number; expected {shape}, {unit}") from None


def _shape_of(value: Any) -> tuple[int, ...] | None:
    """Shape of what can be an array; None of anything else."""
    try:
        return tuple(np.shape(value))
    except (TypeError, ValueError):
        return None


def _shape_words(value: object) -> str:
    shape = _shape_of(value)
    if value is None or not shape:
        return "a single number" if isinstance(value, int | float | np.number) else name_of(value)
    return f"an array {shape}"
