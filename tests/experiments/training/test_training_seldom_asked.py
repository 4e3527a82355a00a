import numpy as np
from steerclear.experiments.training.games import learners_of
from steerclear.experiments.training.seldom_asked import SeldomAsked
from steerclear.experiments.training.settings import settings_of
from steerclear.shield.platforms import layout as L


def test_a_seldom_asked_shield_is_asked_so_often_and_its_answer_is_held():
    batch = learners_of(settings_of({"games": 2, "interval": 10, "rules": {"max_time_s": 60.0}}), None)
    asked, obeyed = [], []

    def answers(core, commands):
        asked.append(core.time_s.copy())
        given = commands.copy()
        given[:, batch.boats] = 1.0, 30.0
        return given

    batch._filter = answers
    held = SeldomAsked(batch, 5)
    inner = held.__call__

    def watched(core, commands):
        answer = inner(core, commands)
        obeyed.append(answer[:, batch.boats, 1] + core.state[:, batch.boats, L.HEADING])
        return answer

    batch._filter = watched
    batch.reset(1)
    batch.step(np.full(batch.learners, 0))
    batch.step(np.full(batch.learners, 0))
    assert len(asked) == 4  # of 20 game steps
    turned = np.array(obeyed).reshape(4, 5, *obeyed[0].shape)
    assert np.abs((turned - turned[:, :1] + 180.0) % 360.0 - 180.0).max() < 1e-9


def test_it_is_in_the_games_where_the_config_says_so():
    given = {"games": 1, "shield": "training", "rules": {"max_time_s": 60.0}}
    assert isinstance(learners_of(settings_of({**given, "shield_every": 10}), None)._filter, SeldomAsked)
    assert not isinstance(learners_of(settings_of(given), None)._filter, SeldomAsked)
