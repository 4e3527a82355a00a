"""What a decision, a solver, a look-up, a batch of games and their memory cost: each measured in one run."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import qpsolvers
from numpy.typing import NDArray
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf, CommandFilter
from steerclear.policies import make_batch
from steerclear.shield import Commands, Decisions, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.filter.program import Program, Solver, solve
from steerclear.shield.jit import Array
from steerclear.shield.platforms import get_platform
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, Tables, table_gradient, table_range_m, table_value
from steerclear.shield.tables.settings import OtherMay
from steerclear.shield.wrappers import games_shield

from .baselines.active_set import OPTIMAL, project
from .jit import kernel
from .play.match import Match
from .play.spec import MatchSpec

QUANTILES = {"p50_us": 0.5, "p99_us": 0.99, "p99_9_us": 0.999}


def time_calls(call: Callable[[int], Any], times: int) -> NDArray[np.float64]:
    """Time ``call(0)``, ``call(1)``, ...: (times,) in us."""
    spent = np.zeros(times)
    for k in range(times):
        begin = time.perf_counter_ns()
        call(k)
        spent[k] = time.perf_counter_ns() - begin
    return spent / 1000.0


def quantiles_us(repeats: Sequence[NDArray[np.float64]]) -> dict[str, float | None]:
    """Quantiles over calls, each call counting with the median of its repeats; None without calls.

    The calls compute the same thing in every repeat, so that the median leaves out what other processes of the
    machine did to single ones.
    """
    if not repeats or not len(repeats[0]):
        return dict.fromkeys(QUANTILES)
    times = np.median(np.stack(repeats), axis=0)
    return {name: float(np.quantile(times, share)) for name, share in QUANTILES.items()}


def memory_mib(make: Callable[[], Any]) -> float:
    """Memory that the object ``make()`` builds holds, MiB; numpy reports its arrays to tracemalloc."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        made = make()
        held = tracemalloc.get_traced_memory()[0] - before
        del made
    finally:
        tracemalloc.stop()
    return held / 2**20


REFERENCE = "daqp"
"""The backend that programs are collected with and others are compared with."""

OPPONENTS = ("easy", "medium", "hidden", "rammer")


@dataclass(frozen=True)
class Question:
    """One call of `Shield.decide`."""

    fleet: Fleet
    wanted: Commands
    surroundings: Surroundings | None


class KeepingShield(Shield):
    """A shield that keeps what it is asked."""

    def __init__(self, config: ShieldConfig) -> None:
        super().__init__(config)
        self.questions: list[Question] = []

    def decide(self, fleet: Fleet, wanted: Commands, surroundings: Surroundings | None = None) -> Decisions:
        """Keep a copy of the question (the game changes its arrays in place), then answer it."""
        kept = replace(fleet, state=fleet.state.copy(), controlled=fleet.controlled.copy())
        self.questions.append(Question(kept, replace(wanted, values=wanted.values.copy()), surroundings))
        return super().decide(fleet, wanted, surroundings)


class ProgramKeepingShield(Shield):
    """A shield that keeps the programs it solves."""

    def __init__(self, config: ShieldConfig) -> None:
        super().__init__(config)
        self.programs: list[Program] = []

    def _solver(self) -> Solver:
        return self._keep

    def _keep(self, program: Program) -> Array | None:
        """Keep a copy, whose arrays stay as they are, and answer it."""
        self.programs.append(Program(program.C.copy(), program.d.copy(), program.z0.copy()))
        return solve(program, REFERENCE)


def questions_of_games(preset: str, game_s: float, seed: int, config: ShieldConfig) -> list[list[Question]]:
    """Play one shielded game of `medium` against each of `OPPONENTS` and keep every question, game by game."""
    return [_questions(preset, opponent, game_s, seed + k, config) for k, opponent in enumerate(OPPONENTS)]


def _questions(preset: str, opponent: str, game_s: float, seed: int, config: ShieldConfig) -> list[Question]:
    rules = {"max_time_s": game_s}
    match = Match(MatchSpec(preset, "medium", opponent, game=seed, seed=seed, shield={}, rules=rules))
    keeping = KeepingShield(replace(config, dt_s=match.env.config.dt_s))
    match.shielding.env.shield = keeping
    match.play()
    match.close()
    return keeping.questions


def answer_all(shield: Shield, games: Sequence[Sequence[Question]]) -> list[Decisions]:
    """Let a shield answer every question of every game, in order."""
    answers = []
    for game in games:
        shield.reset()
        answers += [shield.decide(q.fleet, q.wanted, q.surroundings) for q in game]
    return answers


def programs_of(games: Sequence[Sequence[Question]], config: ShieldConfig, most: int, seed: int) -> list[Program]:
    """Collect the programs the shield solves on these questions, at most ``most``, drawn at random."""
    shield = ProgramKeepingShield(config)
    answer_all(shield, games)
    chosen = np.random.default_rng(seed).permutation(len(shield.programs))[:most]
    return [shield.programs[k] for k in sorted(chosen)]


def scene(boats: int, seed: int, platform: str = "heron", area_per_boat_m2: float = 533.0) -> tuple[Fleet, Any]:
    """Draw a fleet, half of it ours, as dense as six boats in an 80 x 40 m field, all wanting to go somewhere.

    Returns:
        The fleet and its nominal commands.
    """
    rng = np.random.default_rng([boats, seed])
    side_m = float(np.sqrt(boats * area_per_boat_m2))
    places: list[Array] = []
    while len(places) < boats:
        place = rng.uniform(0.0, side_m, 2)
        if all(np.hypot(*(place - other)) > 4.0 for other in places):
            places.append(place)
    fleet = Fleet.of(
        position_m=np.array(places),
        heading_rad=rng.uniform(-np.pi, np.pi, boats),
        speed_mps=rng.uniform(0.0, 2.0, boats),
        team=np.arange(boats) % 2,
        platforms=platform,
    )
    wanted = np.column_stack([np.full(boats, 2.0), rng.uniform(-180.0, 180.0, boats)])
    return fleet, Commands.relative_deg(wanted)


COUNTS = (6, 20, 100, 500)


def decide_times(games: Sequence[Sequence[Question]], config: ShieldConfig, repeats: int) -> dict[str, Any]:
    """Time `Shield.decide` on every question of real games, in their order.

    Returns:
        Quantiles in us for ``all`` decisions, those in which every command ``passes`` and those in which the shield
        ``intervenes``, each with the median of its repeats; ``decisions`` and ``share_intervening`` count them.
    """
    shield = Shield(config)
    changed = np.array([bool(answer.intervened.any()) for answer in answer_all(shield, games)])  # warms up, too
    runs = [_time_once(shield, games) for _ in range(repeats)]
    return {
        "decisions": len(changed),
        "share_intervening": float(changed.mean()),
        "all": quantiles_us(runs),
        "passes": quantiles_us([run[~changed] for run in runs]),
        "intervenes": quantiles_us([run[changed] for run in runs]),
    }


def _time_once(shield: Shield, games: Sequence[Sequence[Question]]) -> NDArray[np.float64]:
    times = []
    for game in games:
        shield.reset()
        shield.decide(game[0].fleet, game[0].wanted, game[0].surroundings)  # makes working memory for the fleet

        def call(k: int, game: Sequence[Question] = game) -> None:
            shield.decide(game[k].fleet, game[k].wanted, game[k].surroundings)

        times.append(time_calls(call, len(game)))
    return np.concatenate(times)


def scaling(config: ShieldConfig, scenes: int, seed: int, counts: Sequence[int] = COUNTS) -> list[dict[str, Any]]:
    """Time one decision for fleets of several sizes, half of the boats ours, at the density of the game.

    Returns:
        Per size `boats`, `ours`, quantiles in us, and `us_per_own_boat`, over random scenes (fewer for large fleets).
    """
    return [_one_size(config, boats, max(3, scenes * min(counts) // boats), seed) for boats in counts]


def _one_size(config: ShieldConfig, boats: int, scenes: int, seed: int) -> dict[str, Any]:
    shield = Shield(config)
    drawn = [scene(boats, seed + k) for k in range(scenes)]
    times = np.zeros(scenes)
    for k, (fleet, wanted) in enumerate(drawn):
        shield.reset()
        shield.decide(fleet, wanted)  # makes working memory and the backups the timed decision goes on from

        def call(_: int, fleet: Any = fleet, wanted: Any = wanted) -> None:
            shield.decide(fleet, wanted)

        times[k] = time_calls(call, 1)[0]
    ours = int(drawn[0][0].controlled.sum())
    figures = quantiles_us([times])
    return {
        "boats": boats,
        "ours": ours,
        "scenes": scenes,
        **figures,
        "us_per_own_boat": (figures["p50_us"] or 0) / ours,
    }


COMPILED = "compiled projection"
Solve = Callable[[Program], Array | None]


def solver_times(programs: Sequence[Program], repeats: int) -> list[dict[str, Any]]:
    """Time every solver on the same programs, the shield's default first.

    Returns:
        Per solver `solver`, quantiles in us, `ratio` of its median to the default's, `solved` (share of programs
        with an answer that passes the shield's own check) and `differs` (largest difference from the default's
        answers, scaled inputs; None where they never both answer).
    """
    names = [REFERENCE, *sorted(set(qpsolvers.available_solvers) - {REFERENCE})]
    ways: dict[str, Solve] = {name: lambda program, name=name: solve(program, name) for name in names}
    ways[COMPILED] = _project
    rows = [_time_solver(name, way, programs, repeats) for name, way in ways.items()]
    reference = rows[0]
    return [_against(row, reference) for row in rows]


def _time_solver(name: str, way: Solve, programs: Sequence[Program], repeats: int) -> dict[str, Any]:
    answers = [way(program) for program in programs]  # warms up, too
    runs = [time_calls(lambda k: way(programs[k]), len(programs)) for _ in range(repeats)]
    return {"solver": name, **quantiles_us(runs), "answers": answers}


def _against(row: dict[str, Any], reference: dict[str, Any]) -> dict[str, Any]:
    pairs = zip(row["answers"], reference["answers"], strict=True)
    gaps = [float(np.abs(a - b).max()) for a, b in pairs if a is not None and b is not None]
    solved = sum(answer is not None for answer in row["answers"])
    figures = {name: value for name, value in row.items() if name != "answers"}
    ratio = row["p50_us"] / reference["p50_us"] if row["p50_us"] is not None else None
    share = solved / len(row["answers"]) if row["answers"] else None
    return {**figures, "ratio": ratio, "solved": share, "differs": max(gaps, default=None)}


def _project(program: Program) -> Array | None:
    answer = np.zeros(len(program.z0))
    return answer if project(program.C, program.d, program.z0, answer) == OPTIMAL else None


PAIR = ("surveyor", "heron")
"""Own boat and opponent of the table."""


@kernel
def _values(tables: Tables, places: Array, out: Array) -> None:
    for k in range(places.shape[0]):
        x, y, own, other, own_mps, other_mps = places[k]
        out[k] = table_value(tables, 0, WHOLE_S, x, y, own, other, own_mps, other_mps)


@kernel
def _gradients(tables: Tables, places: Array, out: Array) -> None:
    for k in range(places.shape[0]):
        x, y, own, other, own_mps, other_mps = places[k]
        slope = table_gradient(tables, 0, WHOLE_S, x, y, own, other, own_mps, other_mps)
        own_part = slope.own_x + slope.own_y + slope.own_heading + slope.own_speed
        out[k] = slope.value_m + own_part + slope.other_heading + slope.other_speed  # all of it is computed


def lookup_times(lookups: int, repeats: int, seed: int) -> list[dict[str, Any]]:
    """Time look-ups at random places of one table, each far from the last: caches help less than in a decision.

    Returns:
        For the ``value`` alone and for the ``value and gradient`` (`what`): `lookups` and the median over repeats of
        the mean time of one, `us`.
    """
    own, other = (get_platform(name) for name in PAIR)
    tables = stack_tables([load_table(own, other, OtherMay.WORST_CASE)])
    draw = np.random.default_rng(seed)
    bearing, range_m = draw.uniform(-np.pi, np.pi, lookups), draw.uniform(0.0, table_range_m(tables, 0), lookups)
    headings = draw.uniform(-np.pi, np.pi, (2, lookups))
    speeds = [draw.uniform(0.0, boat.max_speed_mps, lookups) for boat in (own, other)]
    places = np.column_stack([range_m * np.sin(bearing), range_m * np.cos(bearing), *headings, *speeds])
    ways: dict[str, Callable[..., None]] = {"value": _values, "value and gradient": _gradients}
    return [
        {"what": what, "lookups": lookups, "us": _time_lookups(way, tables, places, repeats)}
        for what, way in ways.items()
    ]


def _time_lookups(way: Callable[..., None], tables: Tables, places: Array, repeats: int) -> float:
    out = np.empty(len(places))
    way(tables, places, out)  # warms up
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter_ns()
        way(tables, places, out)
        spent.append((time.perf_counter_ns() - begin) / 1000.0 / len(places))
    return float(np.median(spent))


SPREAD_STEPS = 100
"""Steps played before timing: boats leave their start places and get in each other's way."""


@dataclass(frozen=True)
class BatchSize:
    """How much to run: games at once, steps per repeat, repeats."""

    games: int = 512
    steps: int = 100
    repeats: int = 5


def steps_per_s(
    preset: str, size: BatchSize, policy: str, seed: int = 0, shield: ShieldConfig | None = None
) -> dict[str, Any]:
    """Game-steps per second with observations and rewards; the policies' own time is left out.

    Args:
        preset: rules of the game.
        size: how much to run.
        policy: batch policy of both teams.
        seed: of starts and policies.
        shield: shield of the blue team; None for none.

    Returns:
        `policy`, `shielded`, `games`, `median`, `low` and `high` over the repeats, per second.
    """
    core = BatchedMctf(GameConfig.preset(preset, default_start=False, max_time_s=1e6), size.games, seed)
    teams = [make_batch(policy), make_batch(policy)]
    for number, team in enumerate(teams):
        team.reset(core, number, seed + number)
    command_filter = None if shield is None else games_shield(core, shield).filter_for(0)
    _time_steps(core, teams, SPREAD_STEPS, command_filter)  # compiles, too
    rates = [
        size.games * size.steps / _time_steps(core, teams, size.steps, command_filter) for _ in range(size.repeats)
    ]
    spread = {"median": float(np.median(rates)), "low": min(rates), "high": max(rates)}
    return {"policy": policy, "shielded": shield is not None, "games": size.games, **spread}


def _time_steps(core: BatchedMctf, teams: list[Any], steps: int, command_filter: CommandFilter | None) -> float:
    actions = np.zeros((core.n_games, core.n_boats, 2))
    spent_s = 0.0
    for _ in range(steps):
        for number, team in enumerate(teams):
            actions[:, core.team == number] = team.act(core, number)
        begin = time.perf_counter()
        core.step(actions, command_filter)
        spent_s += time.perf_counter() - begin
    return spent_s


def batch_memory(preset: str, games: int, shield: ShieldConfig) -> dict[str, Any]:
    """Memory of that many games with observations and rewards, and of one team's shield for them, MiB."""
    small = BatchedMctf(preset, 1, 0)  # compiles: that memory belongs to no game
    games_shield(small, shield)
    core = BatchedMctf(preset, games, 0)
    return {
        "games": games,
        "games_mib": memory_mib(lambda: BatchedMctf(preset, games, 0)),
        "shield_mib": memory_mib(lambda: games_shield(core, shield)),
    }
