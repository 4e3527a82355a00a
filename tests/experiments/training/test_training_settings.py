import numpy as np
import pytest
from steerclear.experiments.training.config_file import read_config
from steerclear.experiments.training.each_game import EachGame
from steerclear.experiments.training.games import core_of, learners_of
from steerclear.experiments.training.pool import Pool
from steerclear.experiments.training.settings import SELF, League, Stage, settings_of
from steerclear.policies.entrants.learned.network import Features, Network
from steerclear.shield.exceptions import ConfigError, PolicyError
from steerclear.shield.platforms import layout as L

NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"presett": "aamas2024"}, "unknown key 'presett' in the config; did you mean preset"),
        ({"ppo": {"batchsize": 4}}, "unknown key 'batchsize' in ppo in the config"),
        ({"stages": {}}, "stages in the config is no list"),
        ({"stages": []}, "stages is empty; give one stage at least"),
        ({"stages": [{"opponents": "medium"}]}, r"opponents is 'medium'; give a list of names"),
        ({"shield": "always"}, "shield is 'always'; choose one of none, deployment"),
        ({"games": True}, "games is True; give a whole number from 1"),
        ({"ppo": {"learning_rate": float("nan")}}, "learning_rate is nan; give a number"),
        ({"stages": [{"cooldown_s": -1.0}]}, "a stage in the config: cooldown_s is -1.0; give a number"),
        ({"stages": [{"rewards": [1]}]}, r"a stage in the config: rewards is \[1\]; give names and weights"),
        ({"stages": [{"shielded": "no"}]}, "a stage in the config: shielded is 'no'; give true or false"),
        ({"net": {"hidden": []}}, r"hidden is \[\]; give a list of widths"),
        ([], "the config is list; give keys and values"),
    ],
)
def test_what_a_config_may_not_say(content, words):
    with pytest.raises(ConfigError, match=words):
        settings_of(content)


def test_a_file_that_is_none_or_no_yaml(tmp_path):
    with pytest.raises(ConfigError, match="cannot read"):
        read_config(tmp_path / "none.yaml")
    (tmp_path / "bad.yaml").write_text("a: [")
    with pytest.raises(ConfigError, match="bad.yaml: line "):
        read_config(tmp_path / "bad.yaml")


def test_a_missing_opponent_and_an_unknown_reward_are_found_at_once():
    with pytest.raises(PolicyError, match="unknown policy 'mediun'; did you mean medium"):
        Pool(Stage(("mediun",)), League(), 0)
    with pytest.raises(ConfigError, match="unknown reward term 'capture'; did you mean captures"):
        learners_of(settings_of({"games": 1, "rewards": {"capture": 1.0}}), None)


def test_the_intervention_term_comes_with_its_shield_mode():
    for shield, there in (("training+intervention", True), ("training", False)):
        settings = settings_of({"shield": shield})
        assert ("intervention" in settings.reward_weights(settings.stages[0])) is there


def test_those_who_beat_the_learner_come_more_often():
    pool = Pool(Stage(("hold", "easy")), League(power=2.0, floor=0.1), 0)
    pool.scores["hold"].extend([1.0] * 10)
    pool.scores["easy"].extend([0.0] * 10)
    assert pool.weights() == pytest.approx({"hold": 0.1, "easy": 1.1})
    draws = [pool._draw() for _ in range(600)]
    assert 0.85 < draws.count("easy") / 600 < 0.97


def test_a_game_keeps_its_opponent_to_its_end():
    """Also a snapshot that made room for a later one: it is drawn no more."""
    core = core_of(settings_of({}), 20, 0)
    core.reset(seed=0)
    pool = Pool(Stage(("hold", SELF)), League(keep=1), 0)
    network = Network([np.zeros((1, core.n_obs, 17), np.float32)], [np.zeros((1, 17), np.float32)], NONE, "tanh",
                      "discrete", 10, core.n_obs)  # fmt: skip
    pool.add_snapshot(network, 1)
    pool.reset(core, 1, 0)
    before = pool.playing.copy()
    assert set(before) == {"hold", "self_1"}
    pool.add_snapshot(network, 2)
    pool.act(core, 1)
    assert (pool.playing == before).all()
    pool.restart(np.ones(20, np.bool_), 1)
    assert set(pool.playing) == {"hold", "self_2"}
    assert set(pool.members) == {"hold", "self_2"}


def test_opponents_of_a_stage_wait_longer_between_tags_and_the_learners_as_the_rules_say():
    core = core_of(settings_of({"rules": {"tagging_cooldown_s": 10.0}}), 1, 0)
    pool = Pool(Stage(("hold",), cooldown_s=40.0), League(), 0)
    core.reset(seed=0)
    pool.reset(core, 1, 0)
    core.tagging_cooldown_s[:] = 0.0
    ready = core.config.tagging_cooldown_s
    waited = {0: [], 1: []}
    for k in range(420):
        commands = np.zeros((1, core.n_boats, 2))
        commands[:, 3:] = pool.act(core, 1)
        core.step(commands)
        for team in waited:
            if (core.tagging_cooldown_s[0, core.team == team] == ready).all():
                waited[team].append((k + 1) * core.config.decision_s)
    assert min(waited[0]) == pytest.approx(10.0, abs=0.11)
    assert min(waited[1]) == pytest.approx(40.0, abs=0.5)


def test_each_game_draws_how_long_its_opponents_wait_and_anew_when_it_begins_anew():
    core = core_of(settings_of({}), 50, 0)
    core.reset(seed=0)
    pool = Pool(Stage(("hold",), cooldown_s=(10.0, 30.0)), League(), 0)
    pool.reset(core, 1, 0)
    before = pool.waits_s.copy()
    assert 10.0 <= before.min() < 14.0
    assert 26.0 < before.max() <= 30.0
    chosen = np.arange(50) < 10
    pool.restart(chosen, 1)
    assert ((pool.waits_s != before) == chosen).all()
    core.tagging_cooldown_s[:] = 0.0
    for _ in range(100):
        pool.act(core, 1)
        core.step(np.zeros((50, core.n_boats, 2)))
    assert core.tagging_cooldown_s[:, 3:] == pytest.approx(
        np.repeat(100.0 / pool.waits_s[:, None], 3, axis=1), abs=0.11
    )


@pytest.mark.parametrize("wrong", [[20, 10], [10], [10, 20, 30], ["a", "b"], [-1, 5]])
def test_a_span_is_two_numbers_the_least_first(wrong):
    with pytest.raises(ConfigError, match="cooldown_s"):
        settings_of({"stages": [{"cooldown_s": wrong}]})


def test_a_policy_of_single_games_that_is_asked_seldom_holds_its_courses_in_between():
    core = core_of(settings_of({}), 1, 0)
    core.reset(seed=3)
    seldom = EachGame("meo", 10)
    seldom.reset(core, 1, 0)
    courses, commands = [], np.zeros((1, core.n_boats, 2))
    for _ in range(30):
        commands[:, 3:] = seldom.act(core, 1)
        courses.append((core.state[0, 3:, L.HEADING] + commands[0, 3:, 1]) % 360.0)
        core.step(commands)
    changed = [k for k in range(1, 30) if not np.allclose(courses[k], courses[k - 1], atol=1e-6)]
    assert changed == [10, 20]
