"""A policy on the water is shown and answers what it does in the game; some steer boats without one."""

import contextlib
import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy.orders import rehearse
from steerclear.experiments.deploy.player import NEED_NO_GAME, Observer, Orders, cast_of, load_player
from steerclear.experiments.deploy.referee import game_config, game_obstacles
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.exceptions import FleetError, FleetFileError, PolicyError
from steerclear.shield.platforms import layout as L

EXACT = """
    # whatever the submission can read goes into what it answers
    seen = [full_obs_normalized[a].tobytes() for a in sorted(full_obs_normalized)]
    seen.append(repr(sorted((str(a), sorted((str(k), float(v)) for k, v in full_obs[a].items())) for a in full_obs)))
    seen.append(repr(sorted((str(k), np.ravel(v).tolist()) for k, v in global_state.items())))
    text = repr(seen) + agent_id
    self.calls += 1
    return (1.5, zlib.crc32(text.encode()) % 3600 / 100.0 - 18.0)  # on into the other half, where boats are tagged
"""


def play_both(fleet, policy, snapshot_of, steps, seed=5, opponent="medium"):
    """Play a game in the env and show the same states to a `Player`; yields the commands of both."""
    env = MctfEnv(game_config(fleet))
    observations, infos = env.reset(seed=1)
    ours = list(cast_of(fleet).ours)
    theirs = [agent_id for agent_id in env.possible_agents if agent_id not in ours]
    team, other = policies.make(policy), policies.make(opponent)
    team.reset(env, ours, seed)
    other.reset(env, theirs, 2)
    player = load_player(Orders(cast_of(fleet), policy, seed=seed))
    with contextlib.ExitStack() as stack:
        for one in (player, team):
            stack.callback(getattr(one, "close", lambda: None))
        for step in range(steps):
            play = player.play(snapshot_of(env, fleet, step))
            actions = team.act(observations, infos) | other.act(observations, infos)
            commands = env.core.commands(env.decode(actions)[np.newaxis])[0]
            yield env, play, commands, [env.possible_agents.index(a) for a in ours], player, observations, infos
            observations, *_, infos = env.step(actions)


@pytest.mark.parametrize(
    ("policy", "side"), [("medium", "blue"), ("hard", "red"), ("hidden", "red"), ("random", "red")]
)
def test_scripted_policies_answer_bit_for_bit_what_they_answer_in_the_game(fleet_of, snapshot_of, policy, side):
    """As absolute commands for all boats of the file, of which rescue and the other team are not ours."""
    fleet = fleet_of(team=side)
    for env, play, commands, ours, *_ in play_both(fleet, policy, snapshot_of, 100):
        assert play.problems == ()
        np.testing.assert_array_equal(play.relative[ours], commands[ours])
        rows = [i for i, boat in enumerate(fleet.boats) if boat.agent is not None and boat.name.startswith(side)]
        assert play.commands.shape == (7, 2)
        assert np.isnan(np.delete(play.commands, rows, axis=0)).all()
        told_rad = play.commands[rows, 1]
        turned = np.degrees(told_rad) - env.core.state[0, ours, L.HEADING] - commands[ours, 1]
        assert np.allclose((turned + 180.0) % 360.0 - 180.0, 0.0, atol=1e-9)
        assert ((told_rad >= 0.0) & (told_rad < 2.0 * math.pi)).all()


def test_a_submission_sees_and_answers_bit_for_bit_what_it_does_in_the_game(fleet_of, snapshot_of, write_entry):
    entry = write_entry(EXACT, start="self.calls = 0", head="import zlib\nimport numpy as np")
    driven = after = 0
    for env, play, commands, ours, player, observations, infos in play_both(fleet_of(), entry, snapshot_of, 250):
        assert play.problems == ()
        np.testing.assert_array_equal(play.relative[ours], commands[ours])
        np.testing.assert_array_equal(play.driven, env.core.driven[0])
        driven += play.driven[:3].sum()
        for agent_id, row in player.observer.observations().items():
            np.testing.assert_array_equal(row, observations[agent_id])
        assert repr(player.observer.infos()) == repr(infos)
        after += driven > 0
        if after == 10:
            return
    pytest.fail("no boat was tagged or out of bounds, and driven by the game")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return float('nan')", "not finite"),
        ("return (1e9, 0.0)", "too large"),
        ("return None", "no answer"),
        ("return 'nowhere'", "field point"),
        ("raise KeyError('wall_9')", "KeyError"),
        ("import sys; sys.exit()", "SystemExit"),
    ],
)
def test_a_boat_without_a_usable_answer_has_no_command_and_the_others_have(
    fleet_of, snapshot_of, write_entry, body, words
):
    fleet = fleet_of()
    guilty = f"if agent_id == 'agent_1' and float(global_state[('agent_0', 'speed')]) >= 0.0:\n    {body}\nreturn 4"
    player = load_player(Orders(cast_of(fleet), write_entry(guilty)))
    env = MctfEnv(game_config(fleet))
    play = player.play(snapshot_of(env, fleet))
    assert np.isnan(play.commands[1]).all()
    assert np.isfinite(play.commands[[0, 2]]).all()
    (problem,) = play.problems
    assert problem.startswith("blue_2: ")
    assert words in problem
    env.core.is_tagged[0, 1] = True
    tagged = player.play(snapshot_of(env, fleet, 1))
    assert np.isfinite(tagged.commands[1]).all(), "the game drives a tagged boat home whatever its policy does"


@pytest.mark.parametrize(
    ("answer", "held", "words"),
    [
        ("{'agent_0': 4, 'agent_2': 4}", [1], ["blue_2: no action for agent_1"]),
        ("{agent: 4 for agent in self.ids + ['agent_9']}", [], ["agent_9: an action for 'agent_9', which is no boat"]),
        ("[4, 4, 4]", [0, 1, 2], ["act answered [4, 4, 4]; return a dict of boat to action"] * 3),
        ("None", [0, 1, 2], ["act answered None; return a dict of boat to action"] * 3),
    ],
)
def test_a_team_that_forgets_a_boat_leaves_it_without_a_command(fleet_of, snapshot_of, tmp_path, answer, held, words):
    (tmp_path / "mine.py").write_text(
        "class Team:\n    def reset(self, env, agent_ids, seed):\n        self.ids = list(agent_ids)\n"
        f"    def act(self, observations, infos):\n        return {answer}\n"
    )
    fleet = fleet_of()
    player = load_player(Orders(cast_of(fleet), f"{tmp_path / 'mine.py'}:Team"))
    play = player.play(snapshot_of(MctfEnv(game_config(fleet)), fleet))
    assert np.flatnonzero(np.isnan(play.commands[:3]).any(axis=1)).tolist() == held
    assert len(play.problems) == len(words)
    assert all(word in problem for word, problem in zip(words, play.problems, strict=True)), play.problems


def test_a_game_that_starts_again_is_a_new_game_for_the_policy(fleet_of, snapshot_of, write_entry):
    entry = write_entry("self.calls += 1\nreturn (1.0, float(self.calls))", start="self.calls = 0")
    player = load_player(Orders(cast_of(fleet_of(1)), entry))
    env = MctfEnv(game_config(fleet_of(1)))
    answers = []
    for time_s in (0.0, 0.1, 0.2, 30.0, 29.9, 0.0, 0.1):
        env.core.time_s[0] = time_s
        answers.append(player.play(snapshot_of(env, fleet_of(1))).relative[0, 1])
    assert answers == [1.0, 2.0, 3.0, 4.0, 5.0, 1.0, 2.0]


def test_without_a_referee_the_game_is_as_at_its_start(fleet_of, snapshot_of):
    fleet = fleet_of()
    env = MctfEnv(game_config(fleet))
    env.core.state[0, 0, :2] = (69.0, 20.0)
    snapshot = dataclasses.replace(snapshot_of(env, fleet), game={})
    observer = Observer(cast_of(fleet))
    assert observer.show(snapshot)
    core = observer.env.core
    assert not core.has_flag.any()
    assert not core.is_tagged.any()
    assert core.on_side[0].tolist() == [False, True, True, True, True, True]
    assert observer.env.players["agent_0"].pos.tolist() == [69.0, 20.0]
    assert not observer.show(snapshot)


def test_boats_never_seen_are_shown_out_of_play_and_everything_is_finite(fleet_of, snapshot_of):
    fleet = fleet_of()
    env = MctfEnv(game_config(fleet))
    snapshot = snapshot_of(env, fleet)
    snapshot.seen[4] = np.nan
    snapshot.seen[5, 2] = np.inf
    snapshot.seen[0, 3] = -0.4
    observer = Observer(cast_of(fleet))
    observer.show(snapshot)
    assert observer.env.core.is_tagged[0].tolist() == [False, False, False, True, True, False]
    assert observer.env.core.state[0, 0, L.SPEED] == 0.0
    for row in observer.observations().values():
        assert np.isfinite(row).all()
    with pytest.raises(FleetError, match="a row per boat"):
        observer.show(Snapshot(0, 0.0, np.zeros((3, 4))))


def test_the_flag_goes_with_the_boat_that_carries_it(fleet_of, snapshot_of):
    fleet = fleet_of()
    env = MctfEnv(game_config(fleet))
    env.core.has_flag[0, 1] = env.core.flag_taken[0, 1] = True
    snapshot = snapshot_of(env, fleet)
    snapshot.seen[1, :2] = (50.0, 30.0)
    observer = Observer(cast_of(fleet))
    observer.show(snapshot)
    assert observer.env.core.flag_position[0, 1].tolist() == [50.0, 30.0]


@pytest.mark.parametrize(
    ("policy", "words"),
    [("mediun", "did you mean medium"), ("no/such/file.zip", "no/such/file.zip"), ("keyboard", "keyboard")],
)
def test_policies_that_cannot_play_are_refused_when_loaded(fleet_of, policy, words):
    with pytest.raises(PolicyError, match=words):
        load_player(Orders(cast_of(fleet_of()), policy))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("rules: {dt_s: 0.2}", r"rules.dt_s is what rate_hz says"),
        ("rules: {max_tim_s: 20}", "max_time_s"),
        ("preset: aamas2023", "aamas2024"),
        ("rules: {max_score: 0}", "max_score"),
    ],
)
def test_rules_that_make_no_game_are_refused(fleet_of, more, words):
    with pytest.raises(FleetFileError, match=words):
        game_config(fleet_of(more=more))


def test_the_game_is_that_of_the_file(fleet_of):
    more = "rate_hz: 5\nrules: {max_time_s: 90, flag_keepout_m: 0}"
    config = game_config(fleet_of(2, more=more, platform="surveyor"))
    assert config.env_bounds_m == (80.0, 40.0)
    assert (config.dt_s, config.max_time_s, config.team_size, config.flag_keepout_m) == (0.2, 90.0, 2, 0.0)
    assert {platform.name for platform in config.platforms} == {"surveyor"}
    assert config.tagging_cooldown_s == 10.0


PAGE = Path(__file__).parents[3] / "docs" / "your_boat.md"
RESCUE = "\n  - {name: rescue, platform: heron, contact: feed}\n"


def file_of(team="blue", more=""):
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text(), flags=re.M | re.S)
    text = (
        text.replace("my_boat.yaml", "heron").replace("team: blue", f"team: {team}").replace("boats:", f"boats:{more}")
    )
    return parse_fleet(text + ('feed: {listen: "127.0.0.1:14700"}\n' if more else ""))


@pytest.mark.parametrize("team", ["blue", "red"])
@pytest.mark.parametrize("more", ["", RESCUE])
def test_waypoints_and_hold_steer_the_boat_of_the_page(team, more):
    fleet = file_of(team, more)
    rehearse(fleet, game_obstacles(fleet))
    own = fleet.names.index("blue_1")
    seen = np.full((len(fleet.names), 4), np.nan)
    seen[own] = 30.0, 40.0, 90.0, 1.0
    speeds = {}
    for policy in ("waypoints", "hold"):
        play = load_player(Orders(cast_of(fleet, policy=policy), policy)).play(Snapshot(0, 0.0, seen))
        assert play.problems == ()
        assert np.isfinite(play.commands[own]).all()
        assert np.isnan(np.delete(play.commands, own, axis=0)).all()
        speeds[policy] = play.commands[own, 0]
    assert speeds["waypoints"] > 0.5
    assert speeds["hold"] == 0.0


def test_a_route_of_the_page_is_sailed_in_turn(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "your_boat.md").read_text(encoding="utf-8")
    (tmp_path / "route.py").write_text(page.partition("`route.py`")[2].split("```python\n")[1].split("```")[0])
    fleet, headings = file_of(), []
    player = load_player(Orders(cast_of(fleet, policy="route.py:route"), f"{tmp_path / 'route.py'}:route"))
    for place in ((20.0, 40.0), (20.0, 20.0), (140.0, 20.0), (140.0, 60.0), (20.0, 60.0), (20.0, 20.0)):
        seen = np.array([[*place, 90.0, 1.0]])
        play = player.play(Snapshot(0, 0.0, seen))
        assert play.problems == ()
        headings.append(round(np.degrees(play.commands[0, 1])) % 360)
        assert play.commands[0, 0] == pytest.approx(1.0, abs=0.5), "half of its top speed"
    assert headings == [180, 90, 0, 270, 180, 90]


def test_a_boat_that_is_not_seen_goes_on_being_answered_for():
    fleet = file_of()
    player = load_player(Orders(cast_of(fleet, policy="waypoints"), "waypoints"))
    for x_m in (30.0, np.nan, 150.0, 170.0):  # the last is out of the field: no game drives it home
        play = player.play(Snapshot(0, 0.0, np.array([[x_m, 40.0, 90.0, 1.0]])))
        assert play.problems == ()
    assert not play.driven[0]


def test_a_policy_that_needs_a_game_says_which_do_not():
    with pytest.raises(FleetFileError, match=f"'medium' needs a game: .*--policy {', '.join(NEED_NO_GAME)} or FILE.py"):
        cast_of(file_of(), policy="medium")
