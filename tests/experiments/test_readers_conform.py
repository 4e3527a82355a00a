"""Readers that say something else than where boats are and what they do are told so; honest ones pass."""

import math
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from gymnasium.spaces import Discrete
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.conformance import NotConforming, check_reader
from steerclear.shield import Fleet, Shield
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import GameFacts, ShieldedParallelEnv, game_reader, reader_of, readers
from steerclear.shield.wrappers.mctf import MctfReader

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "own_reader.py"
REGISTERED = dict(readers._REGISTERED)
LAKE = {"__name__": "lake"}
exec(compile(EXAMPLE.read_text(encoding="utf-8").partition("\ncheck_reader(")[0], str(EXAMPLE), "exec"), LAKE)
readers._REGISTERED.clear()
readers._REGISTERED.update(REGISTERED)
Lake, LakeReader, BOAT, TEAM, DT_S = (LAKE[name] for name in ("Lake", "LakeReader", "BOAT", "TEAM", "DT_S"))
BOTH = np.array([1.0, 1.0])


@pytest.fixture(autouse=True)
def apart(monkeypatch):
    """A registry of the test's own."""
    monkeypatch.setattr(readers, "_REGISTERED", dict(REGISTERED))


def reads(reader, env=Lake):
    game_reader(fits=lambda found: isinstance(found, env))(reader)
    return reader


class Varied(LakeReader):
    """The example's reader, but for how it reads places, headings and speeds."""

    platform, noise_m = BOAT, 0.0

    def __init__(self, env):
        super().__init__(env)
        self.random = np.random.default_rng(3)

    def place(self, position_m):
        return position_m

    def heading_deg(self, rad):
        return 90.0 - np.degrees(rad)

    def speed(self, mps):
        return mps

    def fleet(self, team, shield_autopilot):
        boats = self.env.boats
        return Fleet.of(
            position_m=self.place(boats[:, :2]) + self.random.uniform(-self.noise_m, self.noise_m, (2, 2)),
            heading_deg=self.heading_deg(boats[:, 2]),
            speed_mps=self.speed(boats[:, 3]),
            team=TEAM,
            controlled=np.equal(TEAM, team),
            names=self.agent_ids,
            platforms=self.platform,
        )


def varied(**changes):
    return type("Varied", (Varied,), changes)


def commanding(change):
    return type("Commanding", (LakeReader,), {"commands": lambda self, actions: change(self, actions)})


class PlayedAsIs(LakeReader):
    """Plays what safe answers as if it were an action of the game's."""

    @contextmanager
    def filtering(self, safe):
        step = self.env.step

        def safe_step(actions):
            nominal = self.commands(actions)
            rows = zip(self.agent_ids, nominal, safe(nominal), strict=True)
            changed = {agent: (to[0], np.radians(to[1]) / DT_S) for agent, asked, to in rows if (to != asked).any()}
            return step({**actions, **changed})

        with patch.object(self.env, "step", safe_step):
            yield


class HandsOverAnother(LakeReader):
    """Shows the shield the other turn than commands() reads, and plays what it should."""

    def filtering(self, safe):
        other = np.array([1.0, -1.0])
        return super().filtering(lambda commands: safe(commands * other) * other)


MISREAD = {
    "heading counter-clockwise": (varied(heading_deg=lambda self, rad: 90.0 + np.degrees(rad)), "mirror image"),
    "y downwards": (varied(place=lambda self, at: at * [1.0, -1.0]), "mirror image .* north upwards"),
    "north first": (varied(place=lambda self, at: at[:, ::-1]), "mirror image .* position_m as east and north"),
    "heading from east": (varied(heading_deg=lambda self, rad: -np.degrees(rad)), "move 90 deg to the right of their"),
    "heading backwards": (varied(heading_deg=lambda self, rad: 270.0 - np.degrees(rad)), "180 deg to the right of"),
    "heading in rad": (varied(heading_deg=lambda self, rad: math.pi / 2.0 - rad), r"\(heading_rad in rad\)"),
    "feet": (varied(place=lambda self, at: at / 0.3048), r"move 3\.28 times as far as speed_mps .*a foot is 0\.3048 m"),
    "millimetres": (varied(place=lambda self, at: at * 1e3), "move 1000.00 times as far"),
    "knots": (varied(speed=lambda self, mps: mps / 0.514), r"move 0\.51 times as far as speed_mps"),
    "all in feet": (
        varied(place=lambda self, at: at / 0.3048, speed=lambda self, mps: mps / 0.3048),
        r"are 3\.28 times as fast as their platforms .* the first column of a command is the speed in m/s",
    ),
    "no speed": (varied(speed=lambda self, mps: 0.0 * mps), "too little to compare; look at speed_mps"),
    "a heron": (varied(platform="heron"), "as far as their platforms do; .* the platform has to turn as the game's"),
    "a slow starter": (varied(platform="di"), "gain speed otherwise than their platforms"),
    "turns reversed": (
        commanding(lambda self, actions: LakeReader.commands(self, actions) * [1.0, -1.0]),
        r"turn the other way than their commands say; .* clockwise, deg \(by the commands that commands\(\) reads",
    ),
    "turns in rad": (
        commanding(lambda self, actions: LakeReader.commands(self, actions) * [1.0, math.pi / 180.0]),
        r"turn 57\.30 times as far as their platforms do; .* deg",
    ),
    "turns of a second": (
        commanding(lambda self, actions: LakeReader.commands(self, actions) * [1.0, 10.0]),
        r"turn 0\.\d+ times as far as their platforms",
    ),
    "shares of the top speed": (
        commanding(lambda self, actions: LakeReader.commands(self, actions) * [0.5, 1.0]),
        r"are 2\.00 times as fast as their platforms .* first column of a command is the speed in m/s",
    ),
    "commands of nothing": (commanding(lambda self, actions: np.ones((2, 2))), "boats (turn|do not turn)"),
    "played the other way": (PlayedAsIs, r"turn the other way .*by the commands that filtering plays"),
    "hands over another": (HandsOverAnother, r"hands over other commands than commands\(\) reads"),
    "nobody controlled": (
        varied(fleet=lambda self, team, auto: replace(Varied.fleet(self, 0, auto), controlled=np.zeros(2, bool))),
        "fleet.. controls no boat of team 0 nor of team 1; give Fleet.of team numbers 0 and 1",
    ),
    "one boat": (varied(fleet=lambda self, team, auto: None), "give a Fleet of the 2 boats of agent_ids"),
}


@pytest.mark.parametrize("case", MISREAD)
def test_a_reader_that_misreads_is_told_what_and_the_remedy(case):
    reader, words = MISREAD[case]
    reads(reader)
    with pytest.raises(NotConforming, match=words):
        check_reader(Lake)


@pytest.mark.parametrize("noise_m", [0.0, 0.3, 1.0])
def test_a_reader_whose_places_err_passes(noise_m):
    reads(varied(noise_m=noise_m))
    check_reader(Lake)


def test_errors_do_not_hide_what_is_wrong():
    reads(varied(noise_m=0.5, heading_deg=lambda self, rad: 90.0 + np.degrees(rad)))
    with pytest.raises(NotConforming, match="mirror image"):
        check_reader(Lake)


def test_places_that_tell_nothing_do_not_pass():
    reads(varied(noise_m=30.0))
    with pytest.raises(NotConforming, match="with less noise"):
        check_reader(Lake)


class Observed(MctfReader):
    """Our game through instruments: nothing of the autopilots, all else with errors."""

    def __init__(self, env):
        super().__init__(env)
        self.random = np.random.default_rng(5)

    def fleet(self, team, shield_autopilot):
        seen = super().fleet(team, shield_autopilot)
        state = seen.state.copy()
        state[:, L.SPEED + 1 :] = np.nan
        for column, most in ((L.X, 0.5), (L.Y, 0.5), (L.HEADING, 1.0), (L.SPEED, 0.03)):
            state[:, column] += self.random.uniform(-most, most, len(state))
        return replace(seen, state=state)


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025", "mctf2026"])
def test_our_game_seen_from_outside_passes(preset):
    reads(Observed, MctfEnv)
    check_reader(lambda: MctfEnv(preset))


class Pond(Lake):
    """A lake of discrete actions, 1 to 5, played by way of speeds and turns."""

    TURNS = (-1.0, -0.4, 0.0, 0.4, 1.0)

    def action_space(self, agent):
        return Discrete(5, start=1)

    def pair(self, action):
        if not 1 <= action <= 5:
            raise ValueError(f"no action: {action}")
        return 2.0, self.TURNS[action - 1]

    def step(self, actions):
        return self.play({agent: self.pair(action) for agent, action in actions.items()})

    def play(self, pairs):
        return super().step(pairs)


class PondReader(LakeReader):
    """Patches the continuous entry below step."""

    def commands(self, actions):
        return super().commands({agent: self.env.pair(action) for agent, action in actions.items()})

    @contextmanager
    def filtering(self, safe):
        play = self.env.play

        def safe_play(pairs):
            nominal = LakeReader.commands(self, pairs)
            rows = zip(self.agent_ids, nominal, safe(nominal), strict=True)
            changed = {agent: (to[0], -np.radians(to[1]) / DT_S) for agent, asked, to in rows if (to != asked).any()}
            return play({**pairs, **changed})

        with patch.object(self.env, "play", safe_play):
            yield


class Short(Lake):
    """Is over after a few steps."""

    def step(self, actions):
        outcome = super().step(actions)
        self.agents = [] if self.steps == 4 else self.agents
        return outcome


def test_a_game_that_is_over_before_anything_is_seen_does_not_pass():
    reads(LakeReader, Short)
    with pytest.raises(NotConforming, match=r"too little to compare|or a game of 15 s"):
        check_reader(Short)


def test_few_discrete_actions_from_any_number_on_are_played():
    reads(PondReader, Pond)
    check_reader(Pond)


def test_the_game_of_discrete_actions_is_shielded():
    reads(PondReader, Pond)
    nearest_m = []
    for wrap in (lambda env: env, lambda env: ShieldedParallelEnv(env, Shield.for_game(env))):
        env = wrap(Pond())
        env.reset()
        nearest_m.append(math.inf)
        for _ in range(80):
            env.step(dict.fromkeys(env.agents, 3))
            boats = env.unwrapped.boats
            nearest_m[-1] = min(nearest_m[-1], math.dist(boats[0, :2], boats[1, :2]))
    assert nearest_m[0] < 2.5 <= nearest_m[1]


class Bare(LakeReader):
    """Never asks."""

    @contextmanager
    def filtering(self, safe):
        yield


def test_a_reader_that_plays_bare_is_refused_in_the_first_step():
    reads(Bare)
    env = ShieldedParallelEnv(Lake(), Shield.for_game(Lake()))
    env.reset()
    with pytest.raises(ConfigError, match=r"filtering of the reader Bare never called safe .* boats play bare; let it"):
        env.step(dict.fromkeys(env.agents, (2.0, 0.0)))
    with pytest.raises(NotConforming, match="filtering never calls safe"):
        check_reader(Lake)


def test_a_reader_registered_without_brackets_is_refused():
    with pytest.raises(
        ConfigError, match=r"given the class LakeReader, not fits=; write @game_reader\(fits=lambda env"
    ):
        game_reader(LakeReader)
    with pytest.raises(ConfigError, match="game_reader was given 'Lake', not fits="):
        game_reader("Lake")


GOOD = GameFacts(dt_s=DT_S, radius_m=1.25 * BOTH, team=TEAM, obstacles=False)
FACTS = {
    "a dict": (GOOD._asdict(), r"facts\(\) of the reader Odd gave a dict; return a GameFacts\(dt_s=\.\.\., radius_m="),
    "nothing": (None, r"gave a NoneType; return a GameFacts"),
    "a radius": (GOOD._replace(radius_m=1.25), r"radius_m has shape \(\); give one entry for each of the 2 boats"),
    "one radius": (GOOD._replace(radius_m=BOTH[:1]), r"radius_m has shape \(1,\); give one entry for each of the 2"),
    "no radius": (GOOD._replace(radius_m=[1.0, math.nan]), r"radius_m is \[1.0, nan\]; give finite numbers"),
    "three teams": (GOOD._replace(team=[0, 1, 1]), r"team has shape \(3,\); give one entry for each of the 2 boats"),
    "teams 1 and 2": (GOOD._replace(team=[1, 2]), r"team is \[1, 2\]; number the teams 0 and 1"),
    "no step": (GOOD._replace(dt_s=0.0), r"dt_s is 0.0; give finite numbers of at least 1e-06"),
    "a word": (GOOD._replace(dt_s="0.1"), "dt_s is '0.1'; give finite numbers"),
    "no decision": (GOOD._replace(decision_s=None), "decision_s is None; give s, or 0"),
}


@pytest.mark.parametrize("case", FACTS)
def test_facts_that_are_none_are_refused_at_once(case):
    facts, words = FACTS[case]
    reads(type("Odd", (LakeReader,), {"facts": lambda self: facts}))
    for use in (
        lambda: Shield.for_game(Lake()),
        lambda: ShieldedParallelEnv(Lake(), Shield()),
        lambda: check_reader(Lake),
    ):
        with pytest.raises(ConfigError, match=words):
            use()


def test_facts_may_be_lists():
    reads(type("Plain", (LakeReader,), {"facts": lambda self: GOOD._replace(radius_m=[1.25, 1.25], team=[0, 1])}))
    env = ShieldedParallelEnv(Lake(), Shield.for_game(Lake()))
    env.reset()
    env.step(dict.fromkeys(env.agents, (2.0, 0.0)))
    assert env.shield.config.separation_m == 2.5


MEMBERS = {
    "commands": (None, "commands of the reader Odd is None; define it as a method"),
    "moment": (0.0, "moment of the reader Odd is 0.0; define it as a method"),
    "takes_pairs_only": (None, "takes_pairs_only of the reader Odd is None; give True or False"),
    "agent_ids": (None, "agent_ids of the reader Odd is None; give the names of all boats, each once"),
}


@pytest.mark.parametrize("name", MEMBERS)
def test_members_of_another_kind_are_refused_at_once(name):
    value, words = MEMBERS[name]
    odd = reads(type("Odd", (LakeReader,), {name: value}))
    with pytest.raises(ConfigError, match=words):
        reader_of(Lake())
    with pytest.raises(ConfigError, match=words):
        ShieldedParallelEnv(Lake(), Shield(), reader=odd(Lake()))


@pytest.mark.parametrize("ids", ["ours", (), ("ours", "ours"), ("ours", 3)])
def test_agent_ids_that_are_no_names_are_refused(ids):
    reads(type("Odd", (LakeReader,), {"agent_ids": ids}))
    with pytest.raises(ConfigError, match=r"agent_ids of the reader Odd is .*; give the names of all boats, each once"):
        reader_of(Lake())


def test_boats_that_the_game_has_not_are_refused_at_once():
    reads(type("Odd", (LakeReader,), {"agent_ids": ("us", "theirs")}))
    with pytest.raises(
        ConfigError, match="agent_ids of the reader Odd holds us, which the game has not; it has ours, "
    ):
        ShieldedParallelEnv(Lake(), Shield.for_game(Lake()))
    with pytest.raises(ConfigError, match="holds us, which the game has not"):
        check_reader(Lake)


def test_a_team_without_boats_is_refused():
    reads(type("Odd", (LakeReader,), {"facts": lambda self: GOOD._replace(team=[1, 1])}))
    with pytest.raises(ConfigError, match="the reader Odd has no boat of team blue"):
        ShieldedParallelEnv(Lake(), Shield.for_game(Lake()))


def test_a_fleet_of_fewer_boats_is_refused():
    def fleet(self, team, shield_autopilot):
        return Fleet.of(position_m=[[0.0, 0.0]], heading_deg=[0.0], speed_mps=[0.0], team=[0], platforms=BOAT)

    reads(type("Odd", (LakeReader,), {"fleet": fleet}))
    env = ShieldedParallelEnv(Lake(), Shield.for_game(Lake()))
    env.reset()
    with pytest.raises(ConfigError, match=r"fleet\(\) of the reader Odd gave 1 boats; return a Fleet of the 2 boats"):
        env.step(dict.fromkeys(env.agents, (2.0, 0.0)))
