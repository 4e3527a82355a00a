"""What is registered conforms, and what does not is told."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.conformance import (
    NotConforming,
    check_barrier,
    check_platform,
    check_policy,
    check_reader,
)
from steerclear.policies.entrants import catalogue
from steerclear.shield import Shield, foreign
from steerclear.shield.barriers import registry as barriers
from steerclear.shield.barriers.registry import Barrier, get_barrier
from steerclear.shield.exceptions import ConfigError, PlatformError
from steerclear.shield.platforms import get_platform, known_platforms, register_platform, registry
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import ShieldedParallelEnv, game_reader, reader_of, readers
from steerclear.shield.wrappers.mctf import MctfReader

CLOCKED = {"chao"}
"""Thinks for as long as there is time, so that its answers hang on the machine."""


@pytest.fixture
def apart(monkeypatch):
    """Registries of the test's own."""
    monkeypatch.setattr(catalogue, "_ENTRANTS", dict(catalogue._ENTRANTS))
    monkeypatch.setattr(readers, "_REGISTERED", dict(readers._REGISTERED))
    monkeypatch.setattr(registry, "PLATFORMS", dict(registry.PLATFORMS))


@pytest.mark.parametrize("name", [name for name in policies.names() if name not in {"keyboard", *CLOCKED}])
def test_every_policy_conforms(name):
    check_policy(name)


@pytest.mark.parametrize("name", known_platforms())
def test_every_platform_conforms(name):
    check_platform(name)


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025", "mctf2026"])
def test_our_reader_conforms(preset):
    check_reader(lambda: MctfEnv(preset))


class Team:
    """A policy that goes wrong in a way of the test's choosing."""

    name = "team"

    def __init__(self, answer):
        self.answer = answer

    def reset(self, env, agent_ids, seed):
        self.agents = list(agent_ids)

    def act(self, observations, infos):
        return self.answer(self.agents)


def lacking(agents):
    return dict.fromkeys(agents[1:], 4)


def drawn(agents):
    return {agent: (1.0, float(np.random.default_rng().uniform(-90.0, 90.0))) for agent in agents}


@pytest.mark.parametrize(("answer", "words"), [(lacking, "answers for"), (drawn, "other actions from the same seed")])
def test_a_policy_that_does_not_conform_is_told(apart, answer, words):
    policies.entrant("team", "goes wrong")(lambda: Team(answer))
    with pytest.raises(NotConforming, match=words):
        check_policy("team")


def test_a_policy_of_another_name_is_told(apart):
    policies.entrant("other", "goes wrong")(lambda: Team(lacking))
    with pytest.raises(NotConforming, match="calls itself 'team'"):
        check_policy("other")


def test_a_platform_is_registered_by_decorator_object_and_file(apart, tmp_path):
    @register_platform
    def launch():
        return replace(get_platform("heron"), name="launch", max_speed_mps=1.5)

    assert get_platform("launch").max_speed_mps == 1.5
    register_platform(launch())  # the same again
    path = tmp_path / "gig.yaml"
    path.write_text((registry.SHIPPED / "otter.yaml").read_text().replace('name: "otter"', "name: gig"))
    register_platform(path)
    assert {"launch", "gig"} <= set(known_platforms())
    check_platform("gig")


@pytest.mark.parametrize(
    ("boat", "words"),
    [
        (lambda: replace(get_platform("heron"), max_speed_mps=1.5), "'heron', which is another boat's"),
        (lambda: replace(get_platform("heron"), name="boat.yaml"), "ends like a file"),
        (lambda: "heron", "no platform"),
    ],
)
def test_a_platform_that_cannot_be_registered_is_refused(apart, boat, words):
    with pytest.raises(PlatformError, match=words):
        register_platform(boat)


class Point:
    """An entry point."""

    value = "package.boats"

    def __init__(self, load):
        self.load = load


def broken():
    raise ImportError("no such thing")


GIG = replace(get_platform("heron"), name="gig")
BUOY = Barrier("buoy", lambda x, y, ahead, values: math.hypot(x, y) - 3.0)


@pytest.mark.parametrize(
    ("kind", "others", "found"),
    [
        ("platforms", [Point(lambda: GIG)], lambda: get_platform("gig") == GIG),
        ("barriers", [Point(lambda: BUOY)], lambda: get_barrier("buoy") is BUOY),
        ("readers", [], lambda: isinstance(reader_of(MctfEnv("aamas2024")), MctfReader)),
    ],
)
def test_entry_points_bring_what_they_name_and_broken_ones_are_told(apart, monkeypatch, caplog, kind, others, found):
    monkeypatch.setattr(barriers, "BARRIERS", {})
    monkeypatch.setattr(foreign, "entry_points", lambda group: [Point(broken), *others])
    foreign.load_others.cache_clear()
    assert found()
    assert f"{kind} of package.boats cannot be loaded: ImportError" in caplog.text
    foreign.load_others.cache_clear()


class Shifted(MctfReader):
    """Changes the game while it filters."""

    def filtering(self, safe):
        return super().filtering(lambda commands: safe(commands) * 0.5)


class Stopped(MctfReader):
    """Has no clock."""

    def moment(self):
        return 0.0


class SeenFromOutside(MctfReader):
    """Knows no autopilot's memory, as fleets by `Fleet.of`."""

    def fleet(self, team, shield_autopilot):
        seen = super().fleet(team, shield_autopilot)
        state = seen.state.copy()
        state[:, L.SPEED + 1 :] = np.nan
        return replace(seen, state=state)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_a_reader_may_not_know_all_and_its_env_may_take_any_actions(apart, actions):
    game_reader(lambda env: isinstance(env, MctfEnv))(SeenFromOutside)
    check_reader(lambda: MctfEnv("aamas2024", action_kind=actions))


def test_an_env_in_place_of_its_maker_is_refused():
    with pytest.raises(ConfigError, match="make_env is MctfEnv; give a function"):
        check_reader(MctfEnv("aamas2024"))


@pytest.mark.parametrize(
    ("reader", "words"), [(Shifted, "another one under a filter"), (Stopped, "give the game's time")]
)
def test_a_reader_that_does_not_conform_is_told(apart, reader, words):
    game_reader(lambda env: isinstance(env, MctfEnv))(reader)
    with pytest.raises(NotConforming, match=words):
        check_reader(lambda: MctfEnv("aamas2024"))


def test_a_reader_without_a_part_is_told_which(apart):
    game_reader(lambda env: isinstance(env, MctfEnv))(lambda env: SimpleNamespace(agent_ids=(), takes_pairs_only=False))
    with pytest.raises(ConfigError, match=r"SimpleNamespace has no check_answers, commands, facts, .*; see GameReader"):
        check_reader(lambda: MctfEnv("aamas2024"))


@pytest.mark.parametrize("area_m", [40, (10, 10), (50, 50, -50, -50)])
def test_an_area_of_another_form_is_refused(area_m):
    with pytest.raises(ConfigError, match=r"give \(xmin, ymin, xmax, ymax\), m"):
        check_barrier("none", area_m)


class Drawn(MctfEnv):
    """Begins where a generator of the process says, as Pyquaticus does, or one that no seed sets."""

    draw = staticmethod(np.random.random)

    def reset(self, seed=None, options=None):
        return super().reset(seed=int(1e6 * self.draw()), options=options)


def test_starts_may_be_drawn_by_the_generator_of_the_process_but_not_by_one_without_seed():
    game = GameConfig.preset("aamas2024", default_start=False)
    before = np.random.get_state()[1].copy()  # noqa: NPY002 - as Pyquaticus draws
    check_reader(lambda: Drawn(game))
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    unseeded = type("Unseeded", (Drawn,), {"draw": staticmethod(np.random.default_rng().random)})
    with pytest.raises(NotConforming, match="begins otherwise each time"):
        check_reader(lambda: unseeded(game))


def test_what_nobody_reads_is_refused():
    with pytest.raises(ConfigError, match="cannot read a game from object"):
        check_reader(object)


def test_wrappers_are_looked_through():
    env = ShieldedParallelEnv(MctfEnv("aamas2024"), Shield())
    assert isinstance(reader_of(env), MctfReader)
