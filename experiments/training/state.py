"""All that goes on from one decision to the next, as plain arrays: what a checkpoint holds. No pickles."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError

from .pool import LAST, Pool

_PLAIN = (bool, int, float, str)


def arrays_in(thing: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays that an object or named tuple holds, by name; they are the live ones."""
    items = zip(thing._fields, thing, strict=True) if hasattr(thing, "_fields") else sorted(vars(thing).items())
    for key, value in items:
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            yield f"{name}/{key}", value
        elif hasattr(value, "_fields"):
            yield from arrays_in(value, f"{name}/{key}")


def live_arrays(batch: Any) -> dict[str, np.ndarray]:
    """The arrays of games, counts, rewards, shield and opponents, live."""
    found = dict(arrays_in(batch.core.games, "games"))
    found["observations"] = batch.core.observations
    found |= dict(arrays_in(batch.tallies, "tallies"))
    for name, term in batch.reward.terms.items():
        found |= dict(arrays_in(term, f"reward/{name}"))
    if batch.shield is not None:
        found |= {f"shield/{name}": values for name, values in batch.shield.remembered.items()}
    for name, member in batch.opponent.members.items():
        if not hasattr(member, "plays"):  # those that do play game after game, and begin anew
            found |= dict(arrays_in(member, f"opponent/{name}"))
    return found


def put_arrays(batch: Any, saved: dict[str, np.ndarray]) -> None:
    """Put saved arrays into the live ones.

    Raises:
        ConfigError: they are those of another training.
    """
    for name, live in live_arrays(batch).items():
        if name not in saved or saved[name].shape != live.shape:
            raise ConfigError(f"the checkpoint holds other {name}; resume with the config it was made with")
        live[...] = saved[name]


def pool_facts(pool: Pool) -> dict[str, Any]:
    """What a pool remembers beside arrays."""
    return {
        "members": list(pool.members),
        "seed": pool._seed,
        "playing": [str(name) for name in pool.playing],
        "waits_s": pool.waits_s.tolist(),
        "scores": {name: list(scores) for name, scores in pool.scores.items()},
        "rng": pool._rng.bit_generator.state,
    }


def put_pool(pool: Pool, facts: dict[str, Any]) -> None:
    """Put what `pool_facts` told into a pool with the same members."""
    pool._seed = facts["seed"]
    pool.playing[:] = facts["playing"]
    pool.waits_s[:] = facts["waits_s"]
    pool.scores = {name: deque(scores, maxlen=LAST) for name, scores in facts["scores"].items()}
    pool._rng.bit_generator.state = facts["rng"]


def rng_facts() -> dict[str, Any]:
    """Numpy's global random state, which SB3 shuffles minibatches with."""
    kind, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002
    return {"kind": kind, "keys": keys.tolist(), "position": position, "has_gauss": has_gauss, "cached": cached}


def put_rng(facts: dict[str, Any]) -> None:
    """Put it back."""
    keys = np.array(facts["keys"], np.uint32)
    np.random.set_state((facts["kind"], keys, facts["position"], facts["has_gauss"], facts["cached"]))  # noqa: NPY002
