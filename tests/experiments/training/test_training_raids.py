"""Training of raids: moments of raids, answers held for a time, and a training from beginning to end."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from steerclear.experiments.entries.wrap import write_submission
from steerclear.experiments.training.config import League, Net, Stage, config_of, read_config
from steerclear.experiments.training.env import core_of
from steerclear.experiments.training.opponents import Pool
from steerclear.experiments.training.raids import KINDS, PLACE, Answer, BeginInRaids, RaidsLearner, Recorder, recorded
from steerclear.experiments.training.training import training_of
from steerclear.policies import make_batch
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.raids import SEEN
from steerclear.policies.entrants.undertow.raid import Phase
from steerclear.policies.entrants.undertow.shape import NAMES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L


def moments_of(core, times_s):
    """Moments of a game whose boats sail circles, one of each kind, after so many seconds."""
    found = []
    for step in range(int(10 * max(times_s)) + 1):
        if step / 10 in times_s:
            place = {name: getattr(core.games, name)[0].copy() for name in PLACE}
            found.append((place, [Phase.RUN, True, True, False, -12.0, -40.0, False], len(found), "medium"))
        core.step(np.tile([1.5, 20.0], (1, core.n_boats, 1)))
    return found


def pool_of(core):
    """The opponents that games are recorded from."""
    pool = Pool(Stage(opponents=("hold",)), League(), 1)
    pool.reset(core, 1, 1)
    return pool


@pytest.fixture
def some():
    core = core_of(config_of({}), 1, 5)
    core.reset(seed=5)
    return moments_of(core, (1.0, 2.0, 3.0, 4.0))


def test_games_begin_at_moments_of_the_kinds_asked_for_half_of_them_mirrored(some):
    core = core_of(config_of({}), 200, 1)
    begun = BeginInRaids(core, some, [0.0, 3.0, 0.0, 1.0, 0.0, 0.0], 3)
    core.reset(seed=1)
    assert 0.6 < (begun.drawn == 1).mean() < 0.9
    assert set(begun.drawn) == {1, 3}
    assert 0.3 < begun.mirrored.mean() < 0.7
    x = core.games.state[:, 0, L.X]
    np.testing.assert_array_equal(x, [some[k][0]["state"][0, L.X] for k in begun.drawn])
    before = begun.drawn.copy()
    chosen = np.arange(200) < 100
    core.reset(mask=chosen)
    assert (begun.drawn[chosen] != before[chosen]).any()
    np.testing.assert_array_equal(begun.drawn[~chosen], before[~chosen])


def test_a_mirrored_game_goes_on_as_the_mirror_of_the_game_and_so_does_its_raid(some):
    core = core_of(config_of({}), 2, 1)
    begun = BeginInRaids(core, some, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 3)
    while begun.mirrored.tolist() != [False, True]:
        core.reset(seed=None)
    recorder = Recorder(10, 0.0, 1, pool_of(core))
    recorder.reset(core, 0, 1)
    for game in range(2):
        begun.remind(recorder.raids[game], game)
    assert [raid.upper for raid in recorder.raids] == [True, False]
    assert recorder.raids[0].phase == Phase.RUN
    np.testing.assert_allclose(*recorder.seen(np.arange(2)), atol=1e-6)
    for _ in range(30):
        commands = np.zeros((2, core.n_boats, 2))
        commands[:, :3] = recorder.act(core, 0)
        core.step(commands)
    np.testing.assert_allclose(*recorder.seen(np.arange(2)), atol=1e-5)


def test_a_boat_that_sails_alone_is_recorded_and_its_games_begin_against_the_same_opponent_and_last(tiny, tmp_path):
    changes = {"stages": [{"opponents": ["hold", "hard"]}], "decisions": 1}
    changes["options"] = {"recorded": [0.0], "shares": [0, 0, 0, 0, 1, 0]}
    training = training_of(tiny_raids(tiny, **changes), tmp_path / "run", False)
    training.run()
    moments = training._begun.moments
    of_kind = [moment for moment in moments if moment[2] == KINDS.index("alone")]
    assert {moment[3] for moment in of_kind} == {"hard"}
    assert all(moment[1][-1] for moment in of_kind)
    assert set(training.pool.playing) == {"hard"}
    assert all(raid.unguarded for raid in training.team.raids)
    assert training.batch.core.time_s.min() > 30.0  # though no raid lasts as long as 40 decisions


def test_games_in_which_no_raid_can_begin_are_one_error(tiny, tmp_path):
    config = config_of({"algorithm": "raids", "games": 1, "rules": {"max_time_s": 1.0}})
    with pytest.raises(ConfigError, match="no raid came to 'bait'"):
        BeginInRaids(core_of(config, 1, 1), recorded(config, 0.0, 1), [1] * 6, 1)
    with pytest.raises(ConfigError, match="teams of 3 boats"):
        training_of(tiny_raids(tiny, rules={"team_size": 2}), tmp_path / "run", False)


def learner(**ppo):
    given = {"learning_rate": 0.02, "batch": 64, "epochs": 8, **ppo}
    content = {
        "algorithm": "raids",
        "device": "cpu",
        "ppo": given,
        "net": {"hidden": [16]},
        "options": {"furthest": 1.0},
    }
    return RaidsLearner(config_of(content))


def test_gains_look_ahead_over_the_time_that_answers_are_held():
    one = learner(discount=0.5, gae_lambda=1.0)
    with torch.no_grad():
        one.critic[-1].weight.zero_()
        one.critic[-1].bias.fill_(8.0)
    seen = np.zeros(SEEN, np.float32)
    first = Answer(seen, np.zeros(len(NAMES), np.float32), 0.0, earned=1.0, decisions=2, after=seen)
    last = replace(first, earned=4.0, decisions=1, after=None)
    cut = replace(first, decisions=3)
    answers = [first, last, cut]
    gains, values = one._gains([[first, last], [cut]], answers, one._tensor(np.stack([seen] * 3)))
    np.testing.assert_allclose(values, 8.0)
    np.testing.assert_allclose(gains, [1.0 + 0.25 * 4.0 - 8.0, 4.0 - 8.0, 1.0 + 0.125 * 8.0 - 8.0])


def tiny_raids(tiny, **changes):
    given = {
        "algorithm": "raids",
        "rules": {"max_time_s": 150.0},
        "games": 4,
        "decisions": 700,
        "ppo": {"steps": 40, "batch": 150, "epochs": 2, "critic_first": 1},
        "stages": [{"opponents": ["medium"]}],
        "evaluation": {"every": 20, "games": 2},
        "options": {"recorded": [0.3]},
        "seed": 1,
    }
    return read_config(tiny(**{**given, **changes}))


def test_a_training_begins_in_raids_and_its_network_plays_and_is_begun_with(tiny, tmp_path):
    settings = tiny_raids(tiny)
    training_of(settings, tmp_path / "run", False).run()
    rows = json.loads((tmp_path / "run" / "curve.json").read_text())["rows"]
    assert [row["decisions"] for row in rows] == [160, 320, 480, 640, 800]
    assert rows[0]["games"] > 4  # raids are short
    assert rows[0]["divergence"] == 0.0 < rows[1]["divergence"]
    assert rows[-1]["evaluation"]["medium"]["games"] == 2
    network = read_weights(tmp_path / "run" / "final.npz")
    assert (network.kind, network.interval, network.preset) == ("raids", 10, "aamas2024")
    assert make_batch(f"weights:{tmp_path / 'run' / 'best.npz'}").network.kind == "raids"
    begun = settings.model_copy(update={"start": str(tmp_path / "run" / "final.npz"), "decisions": 1})
    again = training_of(begun, tmp_path / "again", False)
    for one, two in zip(again.network().weights, network.weights, strict=True):
        np.testing.assert_array_equal(one, two)
    with pytest.raises(ConfigError, match="no entry is told"):
        write_submission(network, tmp_path / "solution.zip")
    wider = begun.model_copy(update={"net": Net(hidden=(17,))})
    with pytest.raises(ConfigError, match="start does not fit"):
        training_of(wider, tmp_path / "wider", False)
