"""Crowley-BU-LL: a small network over options, in numpy, and the scripted demonstrator that it learned from."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import PolicyError

from ..observation import Boat, Observation
from ..options import OPTIONS, OptionPlayer, row_of, target
from ..plane import distance
from .network import UNREADABLE

Floats = NDArray[np.float64]
OPTION_NAMES = tuple(OPTIONS)
FORMAT, MAX_BYTES = "steerclear-chooser", 16 * 2**20
NOT_SEEN = frozenset(
    {"option", "since_s", "chosen", "time_s", "boat", "preset", "opponent", "side", "seed", "captures"}
    | {"captures_against"}
)
"""Columns of a demonstration that a choice may not depend on."""
ARRAYS = ("middle", "scale", "w1", "b1", "w2", "b2")
THREAT_M = 40.0


@dataclass
class Chooser:
    """One hidden layer of tanh, and a value per option.

    Attributes:
        names: of its inputs, columns of a demonstration.
        middle, scale: (n,) subtracted from and multiplied with the inputs.
        w1, b1, w2, b2: layers, (n, hidden), (hidden,), (hidden, options), (options,).
        card: its origin.
    """

    names: list[str]
    middle: Floats
    scale: Floats
    w1: Floats
    b1: Floats
    w2: Floats
    b2: Floats
    card: dict[str, Any]

    @staticmethod
    def columns(row: Mapping[str, Any]) -> list[str]:
        """Return the columns of a row that a choice may depend on."""
        return [name for name in row if name not in NOT_SEEN]

    @classmethod
    def fresh(cls, names: list[str], hidden: int, rng: np.random.Generator, card: dict[str, Any]) -> Chooser:
        """Return an untrained network."""
        n, k = len(names), len(OPTION_NAMES)
        w1, w2 = rng.normal(size=(n, hidden)) / np.sqrt(n), rng.normal(size=(hidden, k)) / np.sqrt(hidden)
        return cls(names, np.zeros(n), np.ones(n), w1, np.zeros(hidden), w2, np.zeros(k), card)

    def scale_to(self, seen: Floats) -> None:
        """Scale the inputs to mean 0 and deviation 1."""
        spread = seen.std(axis=0)
        self.middle, self.scale = seen.mean(axis=0), 1.0 / np.where(spread > 1e-9, spread, 1.0)

    def values(self, seen: Floats) -> Floats:
        """Return values (N, options) for inputs (N, n)."""
        values: Floats = np.tanh((seen - self.middle) * self.scale @ self.w1 + self.b1) @ self.w2 + self.b2
        return values

    def choices(self, seen: Floats) -> NDArray[np.int64]:
        """Return the numbers (N,) of the chosen options."""
        return np.argmax(self.values(seen), axis=1)

    def parameters(self) -> list[Floats]:
        """Return the arrays that learning changes."""
        return [self.w1, self.b1, self.w2, self.b2]

    def gradients(self, seen: Floats, chosen: NDArray[np.int64]) -> list[Floats]:
        """Return the gradients of the mean cross-entropy, in the order of `parameters`."""
        x = (seen - self.middle) * self.scale
        hidden = np.tanh(x @ self.w1 + self.b1)
        values = hidden @ self.w2 + self.b2
        share = np.exp(values - values.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        share[np.arange(len(chosen)), chosen] -= 1.0
        share /= len(chosen)
        back = (share @ self.w2.T) * (1.0 - hidden**2)
        return [x.T @ back, back.sum(axis=0), hidden.T @ share, share.sum(axis=0)]


def write_chooser(chooser: Chooser, path: Path) -> Path:
    """Write a chooser, completely or not at all."""
    about = {"format": FORMAT, "names": chooser.names, "options": OPTION_NAMES, "card": chooser.card}
    with whole_file(path, PolicyError) as part, part.open("wb") as file:
        arrays = {name: getattr(chooser, name) for name in ARRAYS}
        np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays)
    return path


def read_chooser(path: Path) -> Chooser:
    """Read a chooser; no code in it runs."""
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > MAX_BYTES:
                raise ValueError("it is too large")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            about = json.loads(str(found["about"]))
            arrays = {name: found[name] for name in ARRAYS}
        if about["format"] != FORMAT or tuple(about["options"]) != OPTION_NAMES:
            raise ValueError("it chooses among other options")
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise ValueError("a number is not finite")
        return Chooser(names=list(about["names"]), card=about["card"], **arrays)
    except UNREADABLE as error:
        raise PolicyError(f"{path} holds no chooser ({error}); train one with algorithm: cloning") from error


class Cloned(OptionPlayer):
    """Chooses options like a scripted demonstrator, by behaviour cloning.

    Args:
        path: of a `Chooser`.
    """

    name = "crowley"

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._chooser: Any = read_chooser(path)

    def wish(self, obs: Observation, number: int) -> str:
        """Return the demonstrator's most likely choice."""
        row = row_of(obs, number, self._choices[number])
        seen = [[float(row[name]) for name in self._chooser.names]]
        return OPTION_NAMES[int(self._chooser.choices(seen)[0])]


class Teacher(OptionPlayer):
    """The demonstrator, used where there are no demonstrations by people.

    A boat with the flag goes home. Others tag an intruder that comes near, or else flank or attack.

    Attributes:
        rows: its choices and what it saw, see `options.row_of`.
    """

    name = "teacher"

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[dict[str, Any]] = []

    def look_round(self, obs: Observation) -> None:
        """Choose, and store the choices."""
        super().look_round(obs)
        self.rows += [row_of(obs, number, choice) for number, choice in enumerate(self._choices)]

    def wish(self, obs: Observation, number: int) -> str:
        """Return the boat's option, see the class."""
        boat, foe = obs.own[number], target(obs, number)
        if boat.carries:
            return "retreat"
        if foe is not None and boat.recharged and boat.on_side and _is_nearest(obs, number, foe):
            return "tag"
        return "attack" if boat.y > 0.5 * obs.size[1] or boat.x > obs.line else "flank"


def _is_nearest(obs: Observation, number: int, foe: Boat) -> bool:
    """Return whether the boat is the nearest free own one to an opponent that has come near."""
    ways = [distance(boat.at, foe.at) if not boat.tagged else 1e9 for boat in obs.own]
    return ways[number] == min(ways) and ways[number] < THREAT_M
