"""What the studies of play rest on: fleet files, the freshness contract, and how breaches are told apart."""

import dataclasses
import json

import pytest
from logged_runs import Encounter, header_of
from play_parts import Part, circumstance, judged, kinds, played, stale, summary, write_fleet
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.fleet_settings import Limits
from steerclear.shield.bridge.messages import Action

CALM = {"after_run": False, "unsteered_s": [0.0, 0.0], "faults": [], "kind": "opponent", "verdict": "unavoidable"}


@pytest.mark.parametrize("per_boat", [False, True])
def test_a_parts_fleet_is_one_that_runs(tmp_path, per_boat):
    fleet = load_fleet(write_fleet(Part("x", "surveyor", per_boat=per_boat), tmp_path))
    assert {boat.platform for boat in fleet.boats} == {"surveyor"}
    assert fleet.coordination == ("per_boat" if per_boat else "team")
    ears = [fleet.feed_listen(boat.name if per_boat else None) for boat in fleet.ours]
    assert len(set(ears)) == (3 if per_boat else 1)
    assert len({boat.link.address for boat in fleet.ours}) == (3 if per_boat else 1)


@pytest.fixture(scope="module")
def tick():
    return list(Encounter(header_of(), 2))[-1]


def test_a_command_from_old_information_needs_its_declared_answer(tick):
    limits = Limits()
    fresh = dataclasses.replace(tick.fleet, age_s=0.1 + 0.0 * tick.fleet.state[:, 0])
    tick = dataclasses.replace(tick, fleet=fresh)
    assert stale(tick, limits) == []
    late = dataclasses.replace(tick, policy_age_s=0.7)
    assert len(stale(late, limits)) == 2
    told = tuple(Action(name, "policy", "hold_course", "late") for name in tick.readings)
    assert stale(dataclasses.replace(late, actions=told), limits) == []
    reading = dataclasses.replace(tick.readings["blue_1"], position_age_s=0.6)
    old = dataclasses.replace(tick, readings={**tick.readings, "blue_1": reading})
    assert stale(old, limits) == ["blue_1: navigation 0.60 s"]
    lost = dataclasses.replace(tick, fleet=dataclasses.replace(fresh, age_s=fresh.age_s + 1.5))
    assert [text.split(":")[0] for text in stale(lost, limits)] == ["red_1", "red_2"]
    end = dataclasses.replace(lost, actions=(Action("all", "end", "stop", "the run ends"),))
    assert stale(end, limits) == []


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, "no fault"),
        ({"faults": ["freeze", "late"]}, "freeze+late"),
        ({"unsteered_s": [0.0, 1.2], "faults": ["mode"]}, "nobody steered it"),
        ({"after_run": True}, "after the run"),
    ],
)
def test_breaches_are_told_apart_by_what_held_the_boats(change, told):
    assert circumstance(CALM | change) == told
    assert kinds([CALM | change] * 2) == {(told, "opponent", "unavoidable"): 2}


def result(part, **more):
    figures = {"jitter_p999_s": 0.001, "read_to_sent_p99_s": 0.002, "commands_without_answer": 0}
    figures |= {"decisions": 10, "decided_the_same": 10, "decided_otherwise": 0}
    content = {"minutes_played": 2.0, "closest_mate_m": 3.0, "closest_opponent_m": 2.0, "load_average_after": 1.0}
    part = json.loads(json.dumps(dataclasses.asdict(part)))
    return {"part": part, "runners": [figures], "breaches": [CALM], **content, **more}


def test_the_summary_counts_what_came_after_runs_apart():
    after = {**CALM, "after_run": True, "kind": "teammate"}
    text = summary([result(Part("a")), result(Part("b"), breaches=[CALM, after]), result(Part("c", shielded=False))])
    assert "shielded: 4.0 min, 2 breaches during runs (0.50 a minute): 0 of team-mates" in text
    assert "; 1 after runs" in text
    assert "unshielded: 2.0 min, 1 breaches" in text


def test_a_part_that_is_kept_is_not_played_again(tmp_path, monkeypatch):
    monkeypatch.setattr("play_parts.STUDIES", tmp_path)
    plays = []
    monkeypatch.setattr("play_parts.play", lambda part, folder: plays.append(part.name) or {"breaches": []})
    first = played(Part("a", minutes=1.0), tmp_path)
    assert played(Part("a", minutes=1.0), tmp_path) == first
    assert plays == ["a"]
    played(Part("a", minutes=2.0), tmp_path)
    assert plays == ["a", "a"]


def test_distances_after_the_run_do_not_count(game_record, tmp_path):
    steps, boats = game_record["position"].shape[0] - 1, game_record["position"].shape[1]
    commanded = (game_record["position"][1:, :, 0] < 1e9) & (game_record["position"][1:, :, 0] > -1e9)
    whole = judged(TRUTH, {**game_record, "commanded": commanded}, 0.0)
    commanded = commanded.copy()
    commanded[steps // 2 :] = False
    half = judged(TRUTH, {**game_record, "commanded": commanded}, 0.0)
    assert commanded.shape == (steps, boats)
    assert half["minutes_played"] == pytest.approx(0.5 * whole["minutes_played"], rel=0.05)
    assert half["closest_opponent_m"] >= whole["closest_opponent_m"]


TRUTH = {"captures": [0, 0], "tags": [0, 0], "let_go_s": 0.0, "breaches": []}
