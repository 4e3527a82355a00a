"""What nobody reads is not written, and leaves no trace in what is."""

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.record import GameRecorder
from steerclear.experiments.play import match, recorder
from steerclear.experiments.play.match import Match
from steerclear.experiments.play.recorder import PlayingEnv, live_view, read_infos
from steerclear.experiments.play.spec import MatchSpec
from steerclear.policies.entrants.play import EntrantTeam

SPEC = MatchSpec(preset="aamas2024", own="ohto", opponent="medium", rules={"max_time_s": 1.0}, judge="none")


class Curious(EntrantTeam):
    """An entrant that looks at its infos."""

    def decide(self, sight):
        return [(0.0, boat.heading) for boat in sight.own]

    def act(self, observations, infos):
        self.seen = set(infos)
        return super().act(observations, infos)


@pytest.mark.parametrize(
    ("teams", "read"),
    [
        ([policies.make("ohto"), policies.make("hard")], False),
        ([policies.make("ohto"), policies.from_callable(lambda obs: 4)], True),
        ([Curious(), policies.make("medium")], True),
    ],
)
def test_infos_are_written_where_somebody_may_read_them(teams, read):
    assert read_infos(teams) == read


def test_a_policy_that_reads_infos_gets_them_in_a_match():
    game = Match(SPEC)
    curious = Curious()
    game.seat(0, curious)
    game.play()
    game.close()
    assert curious.seen == set(game.env.possible_agents)
    game = Match(SPEC)
    game.play()
    game.close()
    assert game.env.infos() == {}


class Recorded:
    """The recorder of the library, in the place of a match's recorder."""

    def __init__(self, game, meta):
        self._game, self._recorder = game, GameRecorder()
        self._recorder.start(game, meta)
        self.finish = self._recorder.finish

    def step(self, *given):
        self._recorder.step(self._game, *given)


def test_a_record_is_the_same_with_infos_and_by_the_library(monkeypatch):
    monkeypatch.setattr(recorder, "FIRST_ROWS", 2)  # so that it has to make room
    lean = match.play_match(SPEC).record
    monkeypatch.setattr(match, "read_infos", lambda teams: True)
    monkeypatch.setattr(match, "Recorder", Recorded)
    whole = match.play_match(SPEC).record
    assert set(lean) == set(whole)
    for name in lean:
        assert lean[name].dtype == whole[name].dtype
        np.testing.assert_array_equal(lean[name], whole[name])


def test_a_live_view_is_of_this_moment():
    env = PlayingEnv("aamas2024")
    env.reset(seed=1)
    live = live_view(env.core)
    for _ in range(3):
        env.step(dict.fromkeys(env.agents, (1.0, 20.0)))
        view = env.view()
        for name in vars(live):
            np.testing.assert_array_equal(getattr(live, name), getattr(view, name))
