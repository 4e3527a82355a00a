"""Policies by name: `make` builds one for a game, `make_batch` for a batch of games."""

from __future__ import annotations

import difflib
import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from steerclear.shield.exceptions import PolicyError

from .entrants import entrants
from .entrants.catalogue import RESERVED
from .keyboard import KeyboardTeam, Keys
from .own import check_own, load_own, own_code
from .protocol import BatchPolicy, TeamPolicy
from .scripted.batch import ScriptedBatch
from .scripted.layout import Behaviour
from .scripted.plan import (
    MEDIUM_REACH_M,
    ROLES,
    Plan,
    checked_number,
    checked_points,
    composition_of,
    roles_of,
    words_of,
)
from .scripted.team import ScriptedTeam
from .submissions.stage import near_files

Roles = str | Sequence[str] | None


@dataclass(frozen=True)
class Entry:
    """A named policy: its description, and a function from its options to its plan."""

    description: str
    plan: Callable[..., Plan]


def _alike(behaviour: Behaviour) -> Callable[[], Plan]:
    return lambda: Plan(boats=(behaviour,))


def _in_roles(level: str, roles: Roles, reach_m: float = MEDIUM_REACH_M) -> Plan:
    """Return the plan of a team of attackers and defenders of a level; one role for all boats, or one each."""
    pair = Behaviour[f"{level}_ATTACK"], Behaviour[f"{level}_DEFEND"]
    return Plan(pair, () if roles is None else words_of("roles", roles, ROLES), reach_m=_reach(reach_m))


def _reach(reach_m: float) -> float:
    return checked_number("reach_m", reach_m, math.inf, "a distance in m above 0")


def _fraction(speed_fraction: float) -> float:
    return checked_number("speed_fraction", speed_fraction, 1.0, "a number above 0 and at most 1")


def _easy(roles: Roles = None) -> Plan:
    return _in_roles("EASY", roles)


def _medium(roles: Roles = None, reach_m: float = MEDIUM_REACH_M) -> Plan:
    return _in_roles("MEDIUM", roles, reach_m)


def _medium_attack(reach_m: float = MEDIUM_REACH_M) -> Plan:
    return Plan(boats=(Behaviour.MEDIUM_ATTACK,), reach_m=_reach(reach_m))


def _hard(roles: Roles = None) -> Plan:
    return Plan(boats=(Behaviour.HARD,)) if roles is None else _in_roles("HARD", roles)


def _hidden(composition: str | int | None = None) -> Plan:
    return replace(_in_roles("MEDIUM", None), roles=None if composition is None else roles_of(composition))


def _rammer(target_team_mates: bool = False, speed_fraction: float = 1.0) -> Plan:
    if not isinstance(target_team_mates, bool):
        raise PolicyError(f"target_team_mates is {target_team_mates!r}; give True or False")
    fraction = _fraction(speed_fraction)
    return Plan(boats=(Behaviour.RAMMER,), speed_fraction=fraction, target_team_mates=target_team_mates)


def _waypoints(points: Any = None, speed_fraction: float = 1.0) -> Plan:
    fraction = _fraction(speed_fraction)
    return Plan(boats=(Behaviour.WAYPOINTS,), points=checked_points(points), speed_fraction=fraction)


def _mixed(boats: str | Sequence[str] = "medium_attack") -> Plan:
    words = words_of("boats", boats, [behaviour.name.lower() for behaviour in Behaviour])
    return Plan(boats=tuple(Behaviour[word.upper()] for word in words))


ENTRIES: dict[str, Entry] = {
    "easy": Entry("organisers' easy team: fixed paths, two attack, one defends (roles=...)", _easy),
    "easy_attack": Entry("every boat loops own base, their flag, own base", _alike(Behaviour.EASY_ATTACK)),
    "easy_defend": Entry("every boat patrols in front of its base", _alike(Behaviour.EASY_DEFEND)),
    "medium": Entry(
        "organisers' medium team: potential fields, two attack, one defends (roles=..., reach_m=...)", _medium
    ),
    "medium_attack": Entry("every boat goes for the flag, pushed off opponents (reach_m=...)", _medium_attack),
    "medium_defend": Entry("every boat chases intruders in its half", _alike(Behaviour.MEDIUM_DEFEND)),
    "hidden": Entry(
        "organisers' hidden team: medium; defends, attacks or is mixed, by seed (composition=...)", _hidden
    ),
    "hard": Entry("every boat attacks, and defends while its flag is threatened (roles=... fixes who does)", _hard),
    "hard_attack": Entry("bolder medium_attack; all return when one has the flag", _alike(Behaviour.HARD_ATTACK)),
    "hard_defend": Entry("every boat stays between its flag and the nearest opponent", _alike(Behaviour.HARD_DEFEND)),
    "hold": Entry("every boat stops", _alike(Behaviour.HOLD)),
    "random": Entry("seeded random walk: discrete actions held for 1 to 5 s", _alike(Behaviour.RANDOM)),
    "rammer": Entry("lead pursuit of the nearest opponent (target_team_mates=..., speed_fraction=...)", _rammer),
    "waypoints": Entry("seeded random waypoints, or given ones (points=..., speed_fraction=...)", _waypoints),
    "mixed": Entry("any mix of the scripted boats (boats='medium_attack,rammer,hold')", _mixed),
}
"""The scripted policies. Further names are the competition's `entrants` and "keyboard"."""

KEYBOARD = "keyboard"
HIDDEN = "hidden"
SB3_PREFIX = "sb3:"
WEIGHTS_PREFIX = "weights:"
"""Prefix of files that ``steerclear export`` wrote. They hold numbers only, so loading one runs no code."""
RESERVED.update((*ENTRIES, KEYBOARD))
KEYBOARD_DESCRIPTION = "a human drives one boat in render mode 'human' (agent=..., others='medium')"


def names() -> list[str]:
    """Return the names that `make` knows, besides paths of submissions, ``sb3:PATH.zip`` and ``weights:PATH.npz``."""
    return [*ENTRIES, *entrants(), KEYBOARD]


def describe() -> dict[str, str]:
    """Return a one-line description of each named policy."""
    named = {**ENTRIES, **entrants()}
    return {name: entry.description for name, entry in named.items()} | {KEYBOARD: KEYBOARD_DESCRIPTION}


def make(name_or_path: str | Path, game: int | None = None, **options: Any) -> TeamPolicy:
    """Build a team policy by name or from a file.

    Args:
        name_or_path: one of `names`; a submission's folder, zip or ``solution.py``; ``sb3:PATH.zip``;
            ``weights:PATH.npz``; or your own ``FILE.py``, ``FILE.py:NAME`` or ``MODULE:NAME``, see `own`.
        game: number of the game in its series; it selects the team of the hidden opponent. Without it the seed decides.
            No other policy uses it.
        **options: the policy's own options, see `describe`.

    Raises:
        PolicyError: an unknown name or option (the message names near matches), or a file that cannot be loaded.
    """
    text = str(name_or_path)
    if text == HIDDEN and game is not None and options.get("composition") is None:
        options["composition"] = composition_of(game)
    if text in ENTRIES:
        return ScriptedTeam(text, _plan(text, options))
    if text in entrants():
        return _call(entrants()[text].build, text, options)
    if text == KEYBOARD:
        return _call(_keyboard, KEYBOARD, options)
    if text.startswith(WEIGHTS_PREFIX):
        from .entrants.learned import load_weights

        return _call(load_weights, text, options, text.removeprefix(WEIGHTS_PREFIX))
    if text.startswith(SB3_PREFIX):
        from .entrants.learned import load_trained
        from .sb3 import load_sb3, trained_here

        path = text.removeprefix(SB3_PREFIX)
        if trained_here(path):
            options.pop("allow_code", None)  # none of its code runs
            return _call(load_trained, text, options, path)
        return _call(load_sb3, text, options, path)
    if (own := own_code(text)) is not None:
        return _call(load_own, text, options, *own)
    if looks_like_path(text):
        from .submissions import load_submission

        return _call(load_submission, text, options, text)
    raise unknown_policy(text)


def check(name_or_path: str | Path) -> None:
    """Check that a policy exists, without loading it, so that long work can be refused before it begins.

    Raises:
        PolicyError: an unknown name (the message names near matches), or no such file.
    """
    text = str(name_or_path)
    if text in names():
        return
    if (own := own_code(text)) is not None:
        return check_own(*own)
    path = Path(text.removeprefix(SB3_PREFIX).removeprefix(WEIGHTS_PREFIX)).expanduser()
    if not text or not (text.startswith((SB3_PREFIX, WEIGHTS_PREFIX)) or looks_like_path(text)):
        raise unknown_policy(text)
    if not path.exists():
        raise PolicyError(
            f"there is no policy at {path}; {near_files(path)}give a submission's folder or zip, sb3:PATH.zip or "
            "weights:PATH.npz"
        )


def make_batch(name: str, **options: Any) -> BatchPolicy:
    """Build a policy for a whole batch of games.

    Args:
        name: name of a scripted policy or of an entrant that plays batches (the learned ones do), ``weights:PATH.npz``,
            or ``sb3:PATH.zip`` (only its tensors are read: no code of it runs).
        **options: the policy's own options.

    Raises:
        PolicyError: an unknown name or option, a file that cannot be loaded, or a policy for single games only.
    """
    if name in ENTRIES:
        return ScriptedBatch(name, _plan(name, options))
    found = _batch_builder(name)
    if found is not None:
        return _call(found[0], name, options, *found[1])
    if name in entrants() or name == KEYBOARD or name.startswith(SB3_PREFIX) or looks_like_path(name):
        others = [each for each, entrant in entrants().items() if entrant.batch is not None]
        raise PolicyError(
            f"{name!r} plays single games only; batches take {', '.join([*ENTRIES, *others])} and learned teams"
        )
    raise unknown_policy(name)


def plays_batches(name: str) -> bool:
    """Return whether `make_batch` accepts a name; its file need not exist."""
    return name in ENTRIES or _batch_builder(name) is not None


def _batch_builder(name: str) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
    """Return the builder of an entrant's or file's batch policy, and its first arguments; None: single games only."""
    from .entrants.learned import batch_builder

    entrant = entrants().get(name)
    if (learned := batch_builder(name)) is not None:
        return learned
    return None if entrant is None or entrant.batch is None else (entrant.batch, ())


def looks_like_path(text: str) -> bool:
    """Return whether a policy's name is a path: it exists, has a separator, or ends like a submission's file."""
    path = "/" in text or "\\" in text or text.endswith((".zip", ".py")) or Path(text).exists()
    return bool(text) and own_code(text) is None and path


def unknown_policy(name: str) -> PolicyError:
    """Return the error for an unknown name."""
    near = difflib.get_close_matches(name, names(), n=3, cutoff=0.5)
    hint = near_files(name, near)
    files = "a submission's folder or zip, sb3:PATH.zip, weights:PATH.npz, your own FILE.py or MODULE:NAME"
    known = f"known: {', '.join(names())}; or give {files}"
    return PolicyError(f"unknown policy {name!r}; {hint}{known}")


def _plan(name: str, options: dict[str, Any]) -> Plan:
    return _call(ENTRIES[name].plan, name, options)


def _keyboard(others: str | TeamPolicy = "medium", agent: int | str = 0, keys: Keys | None = None) -> TeamPolicy:
    return KeyboardTeam(make(others) if isinstance(others, str) else others, agent, keys)


def _call(build: Callable[..., Any], name: str, options: dict[str, Any], *first: Any) -> Any:
    """Call ``build(*first, **options)``; explain misspelt options."""
    known = list(inspect.signature(build).parameters)[len(first) :]
    for option in options:
        if option not in known:
            near = difflib.get_close_matches(option, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"its options are: {', '.join(known) or 'none'}"
            raise PolicyError(f"policy {name!r} has no option {option!r}; {hint}")
    return build(*first, **options)
