"""On boats the shield is given the game's fixed things as in the simulator, and decides the same for it."""

import json
import math

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy.referee import game_config, game_obstacles, state_of
from steerclear.shield import Commands, Shield
from steerclear.shield.bridge.feed import game_state
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.static_obstacles import StaticObstacles
from steerclear.shield.exceptions import FleetFileError
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER
from steerclear.shield.wrappers import ShieldedParallelEnv
from steerclear.shield.wrappers.mctf import MctfReader

STEPS, LEG_STEPS = 2400, 300


def to_and_from_own_flag(env, agents, step):
    """Each boat runs through its own flag's place and away from it in turn."""
    actions = {}
    for i in map(env.possible_agents.index, agents):
        row = env.core.state[0, i]
        x_m, y_m = env.core.flag_home[env.core.team[i]] - row[[L.X, L.Y]]
        away = 180.0 * ((step // LEG_STEPS + i) % 2)
        turn = (math.degrees(math.atan2(x_m, y_m)) + away - row[L.HEADING] + 180.0) % 360.0 - 180.0
        actions[env.possible_agents[i]] = np.array([2.0, turn])
    return actions


class Played:
    """A game in the simulator with the wrapper, and beside it the deployed shield on what referee and links tell."""

    def __init__(self, fleet):
        env = MctfEnv(game_config(fleet))
        self.env = ShieldedParallelEnv(env, Shield(fleet.shield_config), team=fleet.team)
        self.water = StaticObstacles(fleet, game_obstacles(fleet))
        self.shield = Shield(fleet.shield_config, fleet.surroundings)
        self.names = [boat.name for boat in fleet.boats if boat.agent is not None]
        self.reader = MctfReader(env)
        self.fleet, self.beside = fleet, None
        env.command_filter = self._beside  # asked before the wrapper

    def _beside(self, core, commands):
        seen = self.reader.fleet(self.fleet.team_number, shield_autopilot=True)
        told = json.loads(json.dumps(state_of(core, self.names).as_dict()))
        around = self.water.around(game_state(told), 0.1)
        self.beside = self.shield.decide(seen, Commands.relative_deg(commands[0]), around), around
        return commands


@pytest.mark.parametrize("team", ["blue", "red"])
def test_the_same_game_is_decided_the_same_bit_for_bit_with_the_own_flag_home_taken_and_home_again(fleet_of, team):
    # without the edge, which is the game's field in the simulator and the geofence on boats
    fleet = fleet_of(team=team, more="shield: {delay_s: 0.0, edge_m: null}")
    played = Played(fleet)
    env = played.env
    observations, infos = env.reset(seed=1)
    half = len(env.possible_agents) // 2
    sides = {"blue": env.possible_agents[:half], "red": env.possible_agents[half:]}
    ours, theirs = sides[team], sides["red" if team == "blue" else "blue"]
    attackers = policies.make("hard_attack")
    attackers.reset(env.unwrapped, theirs, 2)
    homes, changed = [], 0
    for step in range(STEPS):
        actions = attackers.act(observations, infos) | to_and_from_own_flag(env.unwrapped, ours, step)
        home = not env.unwrapped.core.flag_taken[0, fleet.team_number]
        observations, *_, infos = env.step(actions)
        beside, around = played.beside
        decided = env.decisions
        assert len(around.stops) == 1
        np.testing.assert_array_equal(beside.filtered.values, decided.filtered.values)
        np.testing.assert_array_equal(beside.safety_margin_m, decided.safety_margin_m)
        np.testing.assert_array_equal(beside.reason, decided.reason)
        homes.append(home)
        changed += decided.count_intervened > 0
    assert np.count_nonzero(np.diff(homes)) >= 2, "the flag was taken and came home again"
    assert changed > 100, "boats were sent through the circle"


def test_the_circle_is_the_one_the_simulator_gives_the_shield(fleet_of):
    for team in ("blue", "red"):
        fleet = fleet_of(team=team)
        reader = MctfReader(MctfEnv(game_config(fleet)))
        assert game_obstacles(fleet) == reader.surroundings(fleet.team_number, keep_out=True)


def test_obstacles_of_the_rules_are_there_and_a_file_without_a_game_has_nothing(fleet_of):
    fleet = fleet_of(more="rules: {obstacles: {circle: [[2.0, [40.0, 20.0]]], polygon: [[[50, 5], [55, 5], [52, 9]]]}}")
    fixed = game_obstacles(fleet)
    assert fixed.circles == ((40.0, 20.0, 2.0),)
    assert fixed.polygons == (((50.0, 5.0), (55.0, 5.0), (52.0, 9.0)),)
    alone = parse_fleet(
        """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
boats: [{name: a, team: blue, platform: heron, link: {kind: mavlink, address: "udpin:127.0.0.1:1", system_id: 1}}]
"""
    )
    assert game_obstacles(alone) is OPEN_WATER


def test_rules_that_make_no_game_are_one_clear_error(fleet_of):
    with pytest.raises(FleetFileError, match="flag_keepout"):
        game_obstacles(fleet_of(more="rules: {flag_keepout_m: -1.0}"))
