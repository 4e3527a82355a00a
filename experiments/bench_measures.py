"""Measurements of the cost of decisions, solvers, table look-ups, and batches of games with their memory."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.policies import make_batch
from steerclear.shield import Commands, Decisions, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.decide import begin, decide_all, load_decision
from steerclear.shield.filter.program import Program, Solver, solve
from steerclear.shield.jit import Array, kernel
from steerclear.shield.platforms import get_platform
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, Tables, table_gradient, table_range_m, table_value
from steerclear.shield.tables.settings import OtherMay
from steerclear.shield.workspace import Scene
from steerclear.shield.wrappers import games_shield

from .baselines.active_set import OPTIMAL, project
from .play.match import Match
from .play.spec import MatchSpec

QUANTILES = {"p50_us": 0.5, "p99_us": 0.99, "p99_9_us": 0.999}
REFERENCE = "daqp"
"""The solver that programs are collected with and that others are compared with."""
COMPILED = "active set (baselines)"
"""The compiled solver of the baseline filters; the shield itself uses another."""
OPPONENTS = ("easy", "medium", "hidden", "rammer")
PAIR = ("surveyor", "heron")
"""Own boat and opponent of the value table used for look-ups."""
SPREAD_STEPS, LEAST_STEPS = 100, 5
"""Steps before timing, in which boats leave their starts and meet each other; least number of timed steps."""
STAGES = {"passes": "pass, backups held", "searches": "pass after a search", "changes": "do not pass"}
"""Kinds of decisions: all nominal commands pass with the stored backups; they pass after a search for other backups; or
some command fails the nominal check, so that backups, QP and exact checks follow."""
PARTS = ("all_us", "check_us", "rest_us", "python_us")
"""Times of a decision: total, nominal check, remaining compiled code, and Python around it."""
Times = NDArray[np.float64]


@dataclass(frozen=True)
class BatchSize:
    """Size of a measurement: game steps per repeat, and repeats."""

    game_steps: int = 25_600
    repeats: int = 5


@dataclass(frozen=True)
class BatchRun:
    """A batch of games: rules, policy of both teams, whether blue is shielded, number of games, shield threads."""

    preset: str
    policy: str
    shielded: bool
    games: int
    threads: int = 1


def time_calls(call: Callable[[int], Any], times: int) -> Times:
    """Time ``call(0)``, ``call(1)``, ...: (times,) in us."""
    spent = np.zeros(times)
    for k in range(times):
        begun_ns = time.perf_counter_ns()
        call(k)
        spent[k] = time.perf_counter_ns() - begun_ns
    return spent / 1000.0


def quantiles_us(repeats: Sequence[Times]) -> dict[str, float | None]:
    """Return quantiles over calls, using each call's median over the repeats; None without calls.

    The calls compute the same in every repeat, so the median removes disturbance by other processes.
    """
    if not repeats or not len(repeats[0]):
        return dict.fromkeys(QUANTILES)
    times = np.median(np.stack(repeats), axis=0)
    return {name: float(np.quantile(times, share)) for name, share in QUANTILES.items()}


@dataclass(frozen=True)
class Question:
    """One call of `Shield.decide`."""

    fleet: Fleet
    wanted: Commands
    surroundings: Surroundings | None

    def ask(self, shield: Shield) -> Decisions:
        """Return a shield's answer."""
        return shield.decide(self.fleet, self.wanted, self.surroundings)


class _KeepingShield(Shield):
    """A shield that stores its questions, or the programs it solves, then with `REFERENCE`."""

    def __init__(self, config: ShieldConfig, programs: bool = False) -> None:
        super().__init__(config)
        self.questions, self.programs, self._keeps_programs = list[Question](), list[Program](), programs

    def decide(self, fleet: Fleet, wanted: Commands, surroundings: Surroundings | None = None) -> Decisions:
        """Store a copy of the question (the game changes its arrays in place), then answer it."""
        if not self._keeps_programs:
            kept = replace(fleet, state=fleet.state.copy(), controlled=fleet.controlled.copy())
            self.questions.append(Question(kept, replace(wanted, values=wanted.values.copy()), surroundings))
        return super().decide(fleet, wanted, surroundings)

    def _solver(self) -> Solver | None:
        return self._keep if self._keeps_programs else super()._solver()

    def _keep(self, program: Program) -> Array | None:
        self.programs.append(Program(program.C.copy(), program.d.copy(), program.z0.copy()))
        return solve(program, REFERENCE)


Games = Sequence[Sequence[Question]]


def questions_of_games(
    preset: str,
    game_s: float,
    seed: int,
    config: ShieldConfig,
    own: str = "medium",
    opponents: Sequence[str] = OPPONENTS,
) -> list[list[Question]]:
    """Play one shielded game of a policy against each opponent; return all questions, game by game."""
    found = []
    for number, opponent in enumerate(opponents, start=seed):
        rules = {"max_time_s": game_s}
        match = Match(MatchSpec(preset, own, opponent, game=number, seed=number, shield={}, rules=rules))
        keeping = _KeepingShield(replace(config, dt_s=match.env.config.dt_s))
        match.shielding.env._game.shield = keeping
        match.play()
        match.close()
        found.append(keeping.questions)
    return found


def answer_all(shield: Shield, games: Games) -> list[Decisions]:
    """Let a shield answer every question of every game, in order."""
    answers = []
    for game in games:
        shield.reset()
        answers += [question.ask(shield) for question in game]
    return answers


def programs_of(games: Games, config: ShieldConfig, most: int, seed: int) -> list[Program]:
    """Return at most ``most`` of the programs that the shield solves on these questions, drawn at random."""
    shield = _KeepingShield(config, programs=True)
    answer_all(shield, games)
    chosen = np.random.default_rng(seed).permutation(len(shield.programs))[:most]
    return [shield.programs[k] for k in sorted(chosen)]


def decide_times(games: Games, config: ShieldConfig, repeats: int) -> dict[str, Any]:
    """Time `Shield.decide` on every question of real games, in their order.

    Returns:
        Quantiles in us for ``all`` decisions, those in which every command ``passes`` and those in which the shield
        ``intervenes``, each with the median of its repeats; ``decisions`` and ``share_intervening`` count them.
    """
    shield = Shield(config)
    changed = np.array([bool(answer.intervened.any()) for answer in answer_all(shield, games)])  # warms up, too
    runs = []
    for _ in range(repeats):
        times = []
        for game in games:
            shield.reset()
            game[0].ask(shield)  # allocates working memory for the fleet
            times.append(time_calls(lambda k, game=game: game[k].ask(shield), len(game)))
        runs.append(np.concatenate(times))
    return {
        "decisions": len(changed),
        "share_intervening": float(changed.mean()),
        "all": quantiles_us(runs),
        "passes": quantiles_us([run[~changed] for run in runs]),
        "intervenes": quantiles_us([run[changed] for run in runs]),
    }


def _check(scene: Scene) -> None:
    """Run only the nominal check: two calls of what is compiled, a microsecond more than one."""
    load_decision(0, scene)
    begin(scene)


def stage_times(games: Games, config: ShieldConfig, repeats: int) -> list[dict[str, Any]]:
    """Time the `PARTS` of every decision of real games; return shares and mean times per kind of `STAGES`."""
    shield, found = Shield(config), list[tuple[int, list[float]]]()
    for game in games:
        shield.reset()
        game[0].ask(shield)  # allocates working memory for the fleet
        found += [_parts_of(shield, question, repeats) for question in game[1:]]
    kinds, times = np.array([kind for kind, _ in found]), np.array([spent for _, spent in found])
    rows = []
    for number, kind in enumerate(STAGES):
        mine = times[kinds == number]
        means = mine.mean(axis=0).tolist() if len(mine) else [0.0] * len(PARTS)
        shares = {"share": len(mine) / len(times), "time_share": float(mine[:, 0].sum() / times[:, 0].sum())}
        rows.append({"kind": kind, "decisions": len(mine), **shares, **dict(zip(PARTS, means, strict=True))})
    return rows


def _parts_of(shield: Shield, question: Question, repeats: int) -> tuple[int, list[float]]:
    """Return the kind of a decision and its times in us, as `PARTS`; the shield's state is then as after one call."""
    live = shield.remembered
    before = {name: array.copy() for name, array in live.items()}
    scene: Scene = shield._deciders.scene  # type: ignore[union-attr]

    def timed(function: Callable[[], Any]) -> float:
        spent = []
        for _ in range(repeats):
            for name, array in live.items():
                array[...] = before[name]
            spent.append(time_calls(lambda _: function(), 1)[0])
        return float(np.median(spent))

    whole_us = timed(lambda: question.ask(shield))
    check_us = timed(lambda: _check(scene))
    kind = 2 if (scene.group >= 0).any() else int((scene.searched >= 0).any())
    compiled_us = min(timed(lambda: decide_all(scene)), whole_us)
    check_us = min(check_us, compiled_us)
    return kind, [whole_us, check_us, compiled_us - check_us, whole_us - compiled_us]


def scene(boats: int, seed: int, platform: str = "heron", area_per_boat_m2: float = 533.0) -> tuple[Fleet, Commands]:
    """Draw a fleet, half of it own boats, as dense as six in an 80 x 40 m field, and random nominal commands."""
    rng = np.random.default_rng([boats, seed])
    side_m = float(np.sqrt(boats * area_per_boat_m2))
    places = np.zeros((0, 2))
    while len(places) < boats:
        place = rng.uniform(0.0, side_m, 2)
        if (np.hypot(*(places - place).T) > 4.0).all():
            places = np.vstack([places, place])
    fleet = Fleet.of(
        position_m=places,
        heading_rad=rng.uniform(-np.pi, np.pi, boats),
        speed_mps=rng.uniform(0.0, 2.0, boats),
        team=np.arange(boats) % 2,
        platforms=platform,
    )
    return fleet, Commands.relative_deg(np.column_stack([np.full(boats, 2.0), rng.uniform(-180.0, 180.0, boats)]))


def scaled(config: ShieldConfig, platform: str, boats: int, scenes: int, seed: int) -> dict[str, Any]:
    """Time one decision and its `PARTS` in random scenes of that many boats, half of them own."""
    shield, times, parts, ours = Shield(config), np.zeros(scenes), list[list[float]](), 0
    for k in range(scenes):
        question = Question(*scene(boats, seed + k, platform), None)
        ours = int(question.fleet.controlled.sum())
        shield.reset()
        question.ask(shield)  # allocates working memory and finds the backups that the timed decision starts from
        parts.append(_parts_of(shield, question, 1)[1])
        times[k] = parts[-1][0]
    figures = quantiles_us([times])
    means = dict(zip(PARTS[1:], np.mean(parts, axis=0)[1:].tolist(), strict=True))
    per_boat = (figures["p50_us"] or 0) / ours
    about = {"platform": platform, "boats": boats, "ours": ours, "scenes": scenes}
    return {**about, **figures, **means, "us_per_own_boat": per_boat}


def solver_times(programs: Sequence[Program], repeats: int) -> list[dict[str, Any]]:
    """Time every solver on the same programs, `REFERENCE` first.

    Returns:
        Per solver `solver`, quantiles in us, `ratio` of its median to the first's, `solved` (share of programs
        with an answer that passes the shield's own check) and `differs` (largest difference from the first's
        answers, scaled inputs; None where they never both answer).
    """
    import qpsolvers

    names = [REFERENCE, *sorted(set(qpsolvers.available_solvers) - {REFERENCE})]
    ways: dict[str, Callable[[Program], Array | None]] = {name: lambda p, name=name: solve(p, name) for name in names}
    rows, first, first_us = [], list[Array | None](), None
    for name, way in {**ways, COMPILED: _project}.items():
        answers = [way(program) for program in programs]  # warms up, too
        figures = quantiles_us([time_calls(lambda k, way=way: way(programs[k]), len(programs)) for _ in range(repeats)])
        p50_us = figures["p50_us"]
        first, first_us = (answers, p50_us) if name == REFERENCE else (first, first_us)
        both = [(a, b) for a, b in zip(answers, first, strict=True) if a is not None and b is not None]
        ratio = p50_us / first_us if p50_us is not None and first_us is not None else None
        solved = sum(answer is not None for answer in answers) / len(answers) if answers else None
        differs = max((float(np.abs(a - b).max()) for a, b in both), default=None)
        rows.append({"solver": name, **figures, "ratio": ratio, "solved": solved, "differs": differs})
    return rows


def _project(program: Program) -> Array | None:
    answer = np.zeros(len(program.z0))
    return answer if project(program.C, program.d, program.z0, answer) == OPTIMAL else None


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
        out[k] = slope.value_m + own_part + slope.other_heading + slope.other_speed  # so that all of it is computed


def lookup_times(lookups: int, repeats: int, seed: int) -> list[dict[str, Any]]:
    """Return the median over repeats of the mean look-up time, us; random places leave caches little use."""
    own, other = (get_platform(name) for name in PAIR)
    tables = stack_tables([load_table(own, other, OtherMay.WORST_CASE)])
    draw = np.random.default_rng(seed)
    bearing, range_m = draw.uniform(-np.pi, np.pi, lookups), draw.uniform(0.0, table_range_m(tables, 0), lookups)
    headings = draw.uniform(-np.pi, np.pi, (2, lookups))
    speeds = [draw.uniform(0.0, boat.max_speed_mps, lookups) for boat in (own, other)]
    places = np.column_stack([range_m * np.sin(bearing), range_m * np.cos(bearing), *headings, *speeds])
    rows, out = [], np.empty(lookups)
    for what, way in (("value", _values), ("value and gradient", _gradients)):
        way(tables, places, out)  # warms up
        spent = time_calls(lambda _, way=way: way(tables, places, out), repeats)
        rows.append({"what": what, "lookups": lookups, "us": float(np.median(spent / lookups))})
    return rows


def steps_per_s(runs: Sequence[BatchRun], size: BatchSize, seed: int, shield: ShieldConfig) -> list[dict[str, Any]]:
    """Measure game steps per second with observations and rewards; the policy's own time is excluded.

    Runs alternate in every repeat, so that a temporarily slow machine affects all alike.

    Returns:
        Per run its fields, and `median`, `low` and `high` over the repeats, per second.
    """
    games = [_Batch(run, seed, shield) for run in runs]
    rates = [[one.steps_per_s(size) for one in games] for _ in range(size.repeats)]
    return [
        {**asdict(run), "median": float(np.median(mine)), "low": min(mine), "high": max(mine)}
        for run, mine in zip(runs, zip(*rates, strict=True), strict=True)
    ]


class _Batch:
    """The games of a run, continued from repeat to repeat."""

    def __init__(self, run: BatchRun, seed: int, shield: ShieldConfig) -> None:
        self._core = core = BatchedMctf(
            GameConfig.preset(run.preset, default_start=False, max_time_s=1e6), run.games, seed
        )
        self._teams = [make_batch(run.policy), make_batch(run.policy)]
        for number, team in enumerate(self._teams):
            team.reset(core, number, seed + number)
        self._filter = games_shield(core, shield, threads=run.threads).filter_for(0) if run.shielded else None
        self._actions = np.zeros((core.n_games, core.n_boats, 2))
        self._spent_s(SPREAD_STEPS)  # compiles, too

    def steps_per_s(self, size: BatchSize) -> float:
        steps = max(LEAST_STEPS, size.game_steps // self._core.n_games)
        return self._core.n_games * steps / self._spent_s(steps)

    def _spent_s(self, steps: int) -> float:
        core, spent_s = self._core, 0.0
        for _ in range(steps):
            for number, team in enumerate(self._teams):
                self._actions[:, core.team == number] = team.act(core, number)
            begun = time.perf_counter()
            core.step(self._actions, self._filter)
            spent_s += time.perf_counter() - begun
        return spent_s


def memory_mib(make: Callable[[], Any]) -> float:
    """Return the memory held by the object that ``make()`` builds, MiB; numpy reports its arrays to tracemalloc."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        made = make()
        held = tracemalloc.get_traced_memory()[0] - before
        del made
    finally:
        tracemalloc.stop()
    return held / 2**20


def batch_memory(preset: str, games: int, shield: ShieldConfig) -> dict[str, Any]:
    """Return the memory of that many games with observations and rewards, and of one team's shield for them, MiB."""
    games_shield(BatchedMctf(preset, 1, 0), shield)  # compiles first, so that this memory is not counted
    core = BatchedMctf(preset, games, 0)
    held = {"games_mib": lambda: BatchedMctf(preset, games, 0), "shield_mib": lambda: games_shield(core, shield)}
    return {"games": games, **{name: memory_mib(make) for name, make in held.items()}}
