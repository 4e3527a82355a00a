"""The games of a training: rewards, shield and rules by stage, a shield that is asked seldom, who decides first."""

import numpy as np
import pytest
from steerclear.experiments.training.config import config_of
from steerclear.experiments.training.env import AskedShield, TrainEnv
from steerclear.policies.entrants.learned.network import Features, Network
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L

HOLD = {"opponents": ["hold"]}


def env_of(stages=(HOLD,), first=None, **content):
    given = {"games": 2, "rules": {"max_time_s": 60.0}, "stages": list(stages), **content}
    return TrainEnv(config_of({**given, "evaluation": {"opponents": ["hold"]}}), first)


@pytest.mark.parametrize(
    ("stage", "words"),
    [
        ({"rewards": {"capture": 1.0}}, "unknown reward term 'capture'; did you mean captures"),
        ({"rules": {"team_size": 2}}, "change what boats see"),
        ({"rules": {"env_bounds_m": [60.0, 40.0]}}, "change what boats see"),
        ({"rules": {"platforms": "surveyor"}}, "change what boats see"),
    ],
)
def test_a_later_stage_that_cannot_be_is_found_at_once(stage, words):
    with pytest.raises(ConfigError, match=words):
        env_of([HOLD, {**HOLD, **stage}])


def test_a_stage_may_have_rewards_rules_and_a_shield_of_its_own():
    bare = {**HOLD, "shielded": False, "rewards": {"tagging": 0.5}, "tag_probability": 0.25}
    close = {**HOLD, "shield_settings": {"separation_m": 0.3}}
    env = env_of([bare, close, {**HOLD, "rules": {"catch_radius_m": 5.0}}], shield="training")
    env.begin(0)
    batch = env.batch
    assert (batch.shield, batch._filter, batch.core.rules.tag_probability) == (None, None, 0.25)
    assert batch.reward.weights == {"sparse": 1.0, "progress": 1.0, "tagging": 0.5}
    env.enter(1)
    env.begin(1)
    assert env.batch.shield.config.separation_m == 0.3
    assert env.batch.reward.weights == {"sparse": 1.0, "progress": 1.0}
    assert env.batch.core.rules.tag_probability == batch.core.config.tag_probability
    env.enter(2)
    env.begin(2)
    assert env.batch.shield.config.separation_m == 2.5
    assert env.batch.core.config.catch_radius_m == 5.0


def test_a_seldom_asked_shield_is_asked_so_often_and_its_answer_is_held():
    env = env_of(shield="training", shield_every=5)
    batch, asked, obeyed = env.batch, [], []
    inner = batch._filter
    assert isinstance(inner, AskedShield)

    def answers(core, commands):
        asked.append(core.time_s.copy())
        given = commands.copy()
        given[:, batch.boats] = 1.0, 30.0
        return given

    def watched(core, commands):
        answer = inner(core, commands)
        obeyed.append(answer[:, batch.boats, 1] + core.state[:, batch.boats, L.HEADING])
        return answer

    env.begin(1)
    inner._ask, batch._filter = answers, watched
    for _ in range(2):
        env.decide(np.zeros(batch.learners, int))
    assert len(asked) == 4  # of 20 game steps
    turned = np.array(obeyed).reshape(4, 5, *obeyed[0].shape)
    assert np.abs((turned - turned[:, :1] + 180.0) % 360.0 - 180.0).max() < 1e-9
    assert env.taken()["shield_s"] > 0.0


def test_the_first_network_decides_where_nobody_holds_the_flag():
    none = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
    play = Network([np.zeros((1, 61, 17), np.float32)], [np.eye(17, dtype=np.float32)[3][None]], none, "tanh",
                   "discrete", 10, 61)  # fmt: skip
    env = env_of(first=play)
    env.begin(0)
    assert env._by_first(env.first, np.full(6, 16)).tolist() == [3] * 6
    env.batch.core.has_flag[1, 0] = True
    env.batch.core.observe()
    assert env._by_first(env.first, np.full(6, 16)).tolist() == [3, 3, 3, 16, 16, 16]


def test_hits_of_a_game_are_those_of_all_its_boats():
    env = env_of(rules={"max_time_s": 1.0}, games=1)
    env.begin(0)
    env.batch.core.time_s[:] = 0.0
    env.batch.tallies.totals[6, 0] = [1.0, 2.0, 4.0]
    env.decide(np.zeros(3, int))
    assert [one["hits"] for one in env.ended()] == [7.0]
    assert env.ended() == []
