"""The competition's entrants: either side under every preset, alike when seeded alike."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear import policies
from steerclear.env.arrays import make_rules
from steerclear.env.config import PRESETS, GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_geometry
from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants import catalogue, plane
from steerclear.policies.entrants.lucas import hints_for, home_of
from steerclear.policies.entrants.observation import Boat, look
from steerclear.policies.entrants.plane import row
from steerclear.policies.entrants.play import EntrantTeam
from steerclear.policies.evolution import N_MOVES, STOP, copy_game, evolve, make_scratch, roll_out, score_of
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.foreign import load_others

SIDES = {"blue": slice(0, 3), "red": slice(3, 6)}


def play(name, preset="aamas2024", side="blue", steps=30, seed=2, **options):
    """Commands and positions of an entrant against holding boats."""
    env = MctfEnv(preset)
    observations, infos = env.reset(seed=seed)
    team = policies.make(name, **options)
    team.reset(env, env.possible_agents[SIDES[side]], seed)
    sent = []
    for _ in range(steps):
        actions = team.act(observations, infos)
        sent.append([actions[agent] for agent in env.possible_agents[SIDES[side]]])
        env.core.advance(env.core.commands(env.decode(actions)[None]))
    return np.array(sent), env


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("name", policies.entrants())
def test_entrants_play_both_sides_and_are_deterministic(name, preset):
    for side in SIDES:
        first, env = play(name, preset, side)
        again, _ = play(name, preset, side)
        assert np.isfinite(first).all()
        assert first.tobytes() == again.tobytes()
        assert (first[..., 0] <= env.core.max_speed_mps.max()).all()
        assert (np.abs(first[..., 1]) <= 180.0).all()


@pytest.mark.parametrize("name", ["ohto", "alamer", "meo", "options"])
def test_red_plays_as_blue_turned_round(name):
    env = MctfEnv("aamas2024")
    width, height = env.config.env_bounds_m
    places = [[20.0, 8.0], [22.0, 20.0], [14.0, 33.0], [60.0, 10.0], [47.0, 25.0], [70.0, 31.0]]
    headings = [10.0, 80.0, 170.0, -90.0, -60.0, -100.0]
    turned = [[width - x, height - y] for x, y in places]
    found = []
    for side, at, facing in (
        ("blue", places, headings),
        ("red", turned[3:] + turned[:3], [h + 180.0 for h in headings[3:] + headings[:3]]),
    ):
        init = {"agent_position": at, "agent_heading": [(h + 180.0) % 360.0 - 180.0 for h in facing]}
        observations, infos = env.reset(seed=1, options={"init_dict": init | {"agent_speed": [1.0] * 6}})
        team = policies.make(name)
        team.reset(env, env.possible_agents[SIDES[side]], 1)
        found.append(np.array(list(team.act(observations, infos).values())))
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


@pytest.mark.parametrize("preset", PRESETS)
def test_ohto_holds_the_row_in_which_the_presets_start_boats(preset):
    """Also where a game starts them elsewhere, in disorder and bunched beside the flag: no way is left open."""
    env = MctfEnv(preset)
    env.reset(seed=1)
    starts = env.core.state[0, :3, :2].copy()
    np.testing.assert_allclose(sorted(row(look(env.core, 0))), sorted(starts.tolist()))
    _, held = play("ohto", preset, steps=50)
    np.testing.assert_allclose(held.core.state[0, :3, :2], starts, atol=0.5)
    width, height = env.config.env_bounds_m
    places = [[0.3 * width, 0.9 * height], [0.1 * width, 0.9 * height], [0.1 * width, 0.75 * height]]
    places += [[width - x, height - y] for x, y in places]
    init = {"agent_position": places, "agent_heading": [0.0] * 6, "agent_speed": [0.0] * 6}
    env = held_until(110.0, preset, init)
    found = env.core.state[0, :3]
    off_m = np.linalg.norm(found[:, None, :2] - starts[None], axis=2).min(axis=0)
    assert (off_m < 0.6 * height / 4.0).all()
    assert (found[:, 3] < 0.05).all()


def held_until(time_s, preset, init):
    """A game of Ohto against boats that hold."""
    env = MctfEnv(preset)
    observations, infos = env.reset(seed=1, options={"init_dict": init})
    team, still = policies.make("ohto"), dict.fromkeys(env.possible_agents[3:], -1)
    team.reset(env, env.possible_agents[:3], 1)
    while env.core.time_s[0] < time_s:
        observations, _, _, _, infos = env.step(team.act(observations, infos) | still)
    return env


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 6.3), st.floats(0, 1.9))
@settings(max_examples=60, deadline=None)
def test_a_meeting_point_is_reached_at_the_same_moment_by_both(x, y, heading, speed):
    hunter = Boat(0.0, 0.0, 0.0, 0.0, 2.0, 1.0, False, False, True, True)
    target = Boat(x, y, heading, speed, 2.0, 1.0, False, False, True, True)
    point = plane.meeting_point(hunter, target)
    time_s = plane.distance(hunter.at, point) / hunter.top
    assert plane.distance((x + time_s * target.velocity[0], y + time_s * target.velocity[1]), point) < 1e-6


def test_an_entrant_plays_a_whole_team_of_a_game():
    env = MctfEnv("aamas2024")
    env.reset(seed=1)
    with pytest.raises(PolicyError, match="plays whole teams"):
        policies.make("ohto").reset(env, ["agent_0"], 0)
    with pytest.raises(PolicyError, match="has no game; call reset"):
        policies.make("meo").act({}, {})
    with pytest.raises(PolicyError, match="was not reset for team 0"):
        policies.make_batch("lucas").act(BatchedMctf("mctf2025"), 0)


def test_a_newcomer_is_a_policy_by_name(monkeypatch):
    monkeypatch.setattr(catalogue, "_ENTRANTS", dict(catalogue._ENTRANTS))

    @policies.entrant("rush", "every boat straight to the flag")
    class Rush(EntrantTeam):
        name = "rush"

        def decide(self, obs):
            return [plane.go(boat, obs.goal) for boat in obs.own]

    sent, _ = play("rush", steps=2)
    assert (sent[..., 0] > 0.0).all()
    assert len(policies.fingerprint("rush")) == 16  # of its own file, so that --resume sees it change
    assert policies.fingerprint("ohto") == ""
    with pytest.raises(PolicyError, match="there is an entrant 'ohto' already"):
        policies.entrant("ohto", "another")(Rush)
    with pytest.raises(PolicyError, match="there is a policy 'medium' already; choose another name"):
        policies.entrant("medium", "another")(Rush)
    with pytest.raises(PolicyError, match="cannot be named 'a/b'"):
        policies.entrant("a/b", "a path")(Rush)
    with pytest.raises(PolicyError, match="entrant 'idle' cannot play; give its class: decide"):
        policies.entrant("idle", "says nothing")(type("Idle", (EntrantTeam,), {}))


def test_another_package_enters_a_team_by_an_entry_point(tmp_path, monkeypatch, caplog):
    (tmp_path / "their_team.py").write_text(
        "from steerclear.policies import entrant\n"
        "from steerclear.policies.entrants.play import EntrantTeam\n"
        "@entrant('theirs', 'stays')\n"
        "class Theirs(EntrantTeam):\n"
        "    def decide(self, obs):\n"
        "        return [(0.0, boat.heading) for boat in obs.own]\n"
    )
    info = tmp_path / "their_team-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-team\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{catalogue.GROUP}]\nteam = their_team\nbroken = there_is_no_such\n")
    monkeypatch.setattr(catalogue, "_ENTRANTS", dict(catalogue._ENTRANTS))
    monkeypatch.syspath_prepend(str(tmp_path))
    load_others.cache_clear()
    try:
        assert "theirs" in policies.names()
        assert "entrants of there_is_no_such cannot be loaded: ModuleNotFoundError" in caplog.text
        sent, _ = play("theirs", steps=2)
        assert (sent[..., 0] == 0.0).all()
    finally:
        load_others.cache_clear()


def test_chao_takes_the_flag_of_holding_boats_home():
    env = MctfEnv("aamas2024")
    env.reset(seed=2)
    team = policies.make("chao", planner="astar")
    team.reset(env, env.possible_agents[SIDES["blue"]], 2)
    env.core.tagging_cooldown_s[:] = 0.0  # they hold, and none of them can tag
    for _ in range(900):
        env.core.tagging_cooldown_s[0, 3:] = 0.0
        actions = team.act({}, {})
        env.core.advance(env.core.commands(env.decode(actions)[None]))
        if env.core.captures[0, 0]:
            break
    assert env.core.grabs[0, 0] == env.core.captures[0, 0] == 1


@pytest.mark.parametrize(("side", "corner"), [("blue", (10.0, 70.0)), ("red", (150.0, 10.0))])
@pytest.mark.parametrize("name", ["chao", "options"])
def test_a_carrier_takes_the_flag_to_the_nearer_corner_where_it_counts_there(name, side, corner):
    env = MctfEnv("mctf2026")
    carrier, place = ("agent_1", (60.0, 60.0)) if side == "blue" else ("agent_4", (100.0, 20.0))
    env.reset(seed=1)
    number = env.possible_agents.index(carrier)
    env.core.state[0, number, :2] = place  # back from the other side
    env.core.has_flag[0, number] = env.core.on_side[0, number] = True
    team = policies.make(name)
    team.reset(env, env.possible_agents[SIDES[side]], 1)
    speed, bearing = team.act({}, {})[carrier]
    heading = env.core.state[0, number, 2] + bearing
    towards = math.degrees(math.atan2(corner[0] - place[0], corner[1] - place[1]))
    assert speed > 0.0
    assert (heading - towards + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)


HORIZON = 8


def scenes(config, every=40, steps=400):
    """A live game of `medium` against `hard`, every so many steps."""
    core = BatchedMctf(config, n_games=2, seed=4)
    teams = [policies.make_batch("medium"), policies.make_batch("hard")]
    for team, policy in enumerate(teams):
        policy.reset(core, team, 1)
    half = config.team_size
    commands = np.zeros((2, 2 * half, 2))
    for step in range(steps):
        if step % every == 0:
            yield core
        commands[:, :half], commands[:, half:] = teams[0].act(core, 0), teams[1].act(core, 1)
        core.step(commands)


@pytest.mark.parametrize(
    "config",
    [
        GameConfig.preset("mctf2025", default_start=False, dt_s=0.2),
        GameConfig.preset("aamas2024", default_start=False, tag_probability=0.5),
        GameConfig.preset("mctf2025", default_start=False, decision_steps=10),
        GameConfig.preset("mctf2025", default_start=False, obstacles={"circle": [(6.0, (60.0, 40.0))]}),
    ],
    ids=["2025", "chance", "long decisions", "obstacle"],
)
def test_what_a_search_found_is_worth_what_a_whole_rollout_says(config):
    rules, rng = make_rules(config, field_geometry(config)), np.random.default_rng(3)
    scratch, whole = (make_scratch(config, 10, 3, HORIZON, 1.2) for _ in range(2))
    changed, tagged = 0, 0
    for number, core in enumerate(scenes(config)):
        game, boat = number % 2, number % core.n_boats
        plans = rng.integers(0, N_MOVES, (core.n_boats, HORIZON))
        before, home = plans.copy(), home_of(core, int(core.team[boat]), boat, game)
        hints = hints_for(core, boat, home, game)
        found = evolve(rules, core.games, game, plans, boat, hints, home, rng, scratch)
        copy_game(whole.marks, 0, core.games, game)
        roll_out(rules, whole, plans, boat, 0, True)
        assert found == score_of(rules, whole, boat, home)
        others = np.arange(core.n_boats) != boat
        assert (plans[others] == before[others]).all()
        roll_out(rules, whole, before, boat, 0, True)
        assert found >= score_of(rules, whole, boat, home)
        changed += bool((plans != before).any())
        tagged += int(core.is_tagged.sum())
    assert changed > 5
    assert tagged > 0


def test_a_game_of_a_batch_is_played_as_a_single_one_and_only_those_asked_for():
    config = GameConfig.preset("mctf2025", default_start=False)
    core = BatchedMctf(config, n_games=3, seed=7)
    options = {"population": 4, "generations": 2, "horizon": 5}
    batch = policies.make_batch("lucas", **options)
    batch.reset(core, 1, 20)
    batch.plays(np.array([False, False, True]))
    env = MctfEnv(config, action_kind="continuous")
    env.reset(seed=0)
    team = policies.make("lucas", **options)
    ids = env.possible_agents[3:]
    commands, moved = np.zeros((3, 6, 2)), False
    for step in range(40):
        env.core.restore(core.view(2))
        if step == 0:
            team.reset(env, ids, 22)
        single = team.act({}, {})
        commands[:, 3:] = batch.act(core, 1)
        np.testing.assert_allclose(commands[2, 3:], [single[name] for name in ids], atol=1e-9)
        moved = moved or bool((commands[2, 3:, 0] > 0.0).any())
        core.step(commands)
    assert moved
    assert (batch._plans[:2] == STOP).all()
    assert len(batch.think_times_s) == 4  # one at once for all boats, then one each 1.2 s
