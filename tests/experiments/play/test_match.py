import json
from dataclasses import replace

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.record import read_meta
from steerclear.env.render import Arena, Picture, Scene
from steerclear.env.render.boats import boats_in_violation
from steerclear.experiments.cli_games import STEERING
from steerclear.experiments.play.match import Match, play_match
from steerclear.experiments.play.spec import GAP_M, MatchSpec, opening
from steerclear.policies.entrants.play import EntrantTeam
from steerclear.policies.keyboard import AHEAD, BACK, LEFT, RIGHT
from steerclear.shield.exceptions import ConfigError

SHORT = {"max_time_s": 6.0}
OWN = ["agent_0", "agent_1", "agent_2"]


def spec_of(own="medium", opponent="easy", **settings):
    return MatchSpec("aamas2024", own, opponent, rules=settings.pop("rules", SHORT), **settings)


@pytest.fixture
def custom(monkeypatch):
    """Policies by name that a test makes up."""
    made, make = {}, policies.make
    monkeypatch.setattr(policies, "make", lambda name, **kw: made[name]() if name in made else make(name, **kw))
    return made


class Made:
    """A policy whose answers a function gives."""

    name = "made"

    def __init__(self, answer):
        self.answer = answer
        self.step = 0

    def reset(self, env, agent_ids, seed):
        self.ids = list(agent_ids)

    def act(self, observations, infos):
        self.step += 1
        return {agent_id: self.answer(self.step, agent_id) for agent_id in self.ids}


def test_the_same_spec_is_the_same_game_to_the_bit_and_another_seed_is_not():
    first, again = play_match(spec_of(shield={})), play_match(spec_of(shield={}))
    for name, array in first.record.items():
        np.testing.assert_array_equal(array, again.record[name])
    off = play_match(spec_of())
    for name in ("position", "heading_deg"):
        np.testing.assert_array_equal(off.record[name][0], first.record[name][0], "off and on start alike")
    other = play_match(spec_of(shield={}, seed=1))
    assert not np.array_equal(first.record["position"], other.record["position"])


def test_the_record_and_the_game_agree_on_collisions():
    match = Match(spec_of("rammer", "rammer", rules={"max_time_s": 40.0}))
    row = match.play().row
    team = match.env.core.collisions[0, :3]
    assert row["collisions"] == team.sum() > 0


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda step, agent_id: 1 // (step != 3) * 16, "ZeroDivisionError"),
        (lambda step, agent_id: (float("nan"), 0.0) if step == 3 else 16, "not finite"),
        (lambda step, agent_id: 99 if step == 3 else 16, "out of range"),
        (lambda step, agent_id: "NOWHERE" if step == 3 else 16, "unknown field point"),
    ],
)
def test_a_policy_that_fails_mid_game_does_not_end_it(custom, answer, words, caplog):
    custom["made"] = lambda: Made(answer)
    row = play_match(spec_of("made", "made", side="red")).row
    assert row["steps"] == 60
    assert row["policy_failures"] >= 1
    assert row["opponent_policy_failures"] >= 1
    assert "step 3" in row["first_failure"]
    assert words in row["first_failure"]
    assert "boats without an action stop" in caplog.text


@pytest.mark.parametrize(
    ("answer", "times", "usable", "words"),
    [
        ({"agent_0": 4, "agent_1": 4}, 60, 60, "step 1: no action for agent_2"),
        ({"agent_1": 4}, 120, 60, "no action for agent_0"),
        ({}, 180, 0, "no action for agent_0"),
        ({"agent_0": 4, "agent_1": 4, "agent_2": None}, 60, 60, "agent_2: no answer: the policy returned None"),
        ({"agent_0": 4, "agent_1": 4, "agent_2": 4, "agent_7": 4}, 60, 60, "an action for 'agent_7', which is no boat"),
        (None, 60, 0, "act answered None; return a dict of boat to action, such as {'agent_0': 4, ...}"),
        ([4, 4, 4], 60, 0, "act answered [4, 4, 4]; return a dict of boat to action"),
        (4, 60, 0, "act answered 4; return a dict"),
    ],
)
def test_a_team_that_forgets_a_boat_or_answers_no_dict_is_told_once_and_the_others_sail(
    custom, answer, times, usable, words, caplog
):
    custom["made"] = lambda: type("Made_", (Made,), {"act": lambda self, observations, infos: answer})(None)
    result = play_match(spec_of("made", "hold"))
    row, speed = result.row, result.record["speed_mps"]
    assert (row["policy_failures"], row["policy_usable_steps"]) == (times, usable)
    assert words in row["first_failure"]
    assert "Error" not in row["first_failure"]
    assert len([one for one in caplog.messages if "policy failed" in one]) == 1
    if isinstance(answer, dict):
        for boat, name in enumerate(OWN):
            assert (speed[-1, boat] > 1.0) == (answer.get(name) == 4)


def test_a_watcher_may_end_the_game():
    seen = []

    def watch(env):
        seen.append(float(env.core.time_s[0]))
        return len(seen) < 5

    assert play_match(spec_of(), watch).row["steps"] == 5
    assert seen == sorted(seen)


def test_a_spec_travels_through_json_and_its_key_names_the_game():
    spec = spec_of(shield={"separation_m": 3.0})
    assert MatchSpec.of_job(json.loads(json.dumps(spec.as_job()))).key == spec.key
    assert spec.key == spec_of(shield={"separation_m": 3.0}).key
    assert len({spec.key, spec_of().key, replace(spec, seed=9).key, replace(spec, penalty=0.0).key}) == 4
    assert replace(spec, files=("12ab", "")).key not in (spec.key, replace(spec, files=("", "12ab")).key)


@pytest.mark.parametrize(("preset", "seed"), [("aamas2024", 0), ("aamas2024", 1), ("mctf2025", 0), ("mctf2025", 1)])
def test_openings_leave_room(preset, seed):
    config = GameConfig.preset(preset)
    start = opening(config, seed)
    places = np.array(start["agent_position"])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(6, 1)]
    middle = config.env_bounds_m[0] / 2
    assert gaps.min() >= min(GAP_M, config.env_bounds_m[1] / 6)
    assert (places[:3, 0] < middle).all()
    assert (places[3:, 0] > middle).all()
    assert opening(config, seed) == start != opening(config, seed + 1)


def test_an_opening_stays_clear_of_obstacles_and_says_when_there_is_no_room():
    polygon = ((10.0, 5.0), (30.0, 5.0), (30.0, 35.0), (10.0, 35.0))
    config = GameConfig.preset("aamas2024", obstacles={"polygon": [polygon], "circle": [(4.0, (60.0, 20.0))]})
    with pytest.raises(ConfigError, match="no start places found"):
        opening(config, 0)
    config = GameConfig.preset("aamas2024", team_size=1, obstacles={"circle": [(4.0, (20.0, 20.0))]})
    place = np.array(opening(config, 0)["agent_position"][0])
    assert np.linalg.norm(place - [20.0, 20.0]) > 4.0 + GAP_M


class Curious(EntrantTeam):
    """An entrant that looks at its infos."""

    def decide(self, obs):
        return [(0.0, boat.heading) for boat in obs.own]

    def act(self, observations, infos):
        self.seen = set(infos)
        return super().act(observations, infos)


@pytest.mark.parametrize("team", [None, Curious(), policies.from_callable(lambda obs: 4)])
def test_infos_are_written_where_somebody_may_read_them(team):
    spec = MatchSpec(preset="aamas2024", own="ohto", opponent="medium", rules={"max_time_s": 1.0}, judge="none")
    game = Match(spec)
    if team is not None:
        game.seat(0, team)
    game.play()
    game.close()
    assert (game.env.infos() != {}) == (team is not None)
    if isinstance(team, Curious):
        assert team.seen == set(game.env.possible_agents)


def drawn(record, **changes):
    arena = replace(Arena.from_meta(read_meta(record)), **changes)
    surface = Picture(arena, 1280, "light").draw(Scene.from_record(record, 20, 0.1), True)
    return np.frombuffer(surface.get_buffer().raw, np.uint8).reshape(surface.get_height(), -1).copy()


def test_the_steered_boat_is_ringed_and_the_keys_stand_below(game_record):
    plain, marked = drawn(game_record), drawn(game_record, steered=frozenset(["agent_0"]))
    changed = (plain != marked).any(axis=1)
    assert changed[-40:].any(), "the keys"
    assert changed[62:-40].any(), "the ring and the name"
    assert not (drawn(game_record, steered=frozenset()) != plain).any()
    assert set(STEERING.replace(",", "").replace(":", "").split()) >= AHEAD | BACK | LEFT | RIGHT


@pytest.mark.parametrize(("own", "opponent", "steered"), [
    ("keyboard", "hold", {"agent_0"}), ("hold", "keyboard", {"agent_3"}), ("hold", "easy", set()),
])  # fmt: skip
def test_the_first_boat_of_a_keyboard_team_is_steered(own, opponent, steered):
    match = Match(MatchSpec(preset="aamas2024", own=own, opponent=opponent), "human" if steered else None)
    try:
        assert match._steered() == steered
    finally:
        match.close()


def test_violations_of_others_among_themselves_are_not_marked_where_boats_are_shielded(game_record):
    """Boats 2 and 3 are nobody's that is shielded: their picture is the same however close they are."""
    record = {name: array.copy() for name, array in game_record.items()}
    record["position"][:, 3] = record["position"][:, 2] + [0.0, 1.0]
    arena = Arena.from_meta(read_meta(record))
    scene = Scene.from_record(record, 20, 0.1)
    assert (2, 3) in boats_in_violation(scene, arena.separation_m)
    shielded, other = drawn(record), drawn(record, shielded=frozenset(["agent_2"]))
    violation = np.array([190, 24, 147])
    count = [
        int((rows.reshape(len(rows), -1, 4)[..., 2::-1] == violation).all(axis=2).sum()) for rows in (shielded, other)
    ]
    assert count[0] < count[1]
