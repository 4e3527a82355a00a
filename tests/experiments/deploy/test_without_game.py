"""One boat without a game: the page's file is read, and policies that look at nobody steer it."""

import re
from pathlib import Path

import numpy as np
import pytest
from steerclear.experiments.deploy.orders import rehearse
from steerclear.experiments.deploy.player import NEED_NO_GAME, Orders, cast_of, load_player
from steerclear.experiments.deploy.rules import game_obstacles
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.exceptions import FleetFileError

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


def test_a_boat_that_is_not_seen_goes_on_being_answered_for():
    fleet = file_of()
    player = load_player(Orders(cast_of(fleet, policy="waypoints"), "waypoints"))
    for x_m in (30.0, np.nan, 150.0, 170.0):  # the last is out of the field: no game drives it home
        play = player.play(Snapshot(0, 0.0, np.array([[x_m, 40.0, 90.0, 1.0]])))
        assert play.problems == ()
    assert not play.driven[0]


def test_a_policy_that_needs_a_game_says_which_do_not():
    with pytest.raises(FleetFileError, match=f"'medium' needs a game: .*--policy {' or '.join(NEED_NO_GAME)}"):
        cast_of(file_of(), policy="medium")
