"""Play of three against three over loopback MAVLink in real time: whole parts, resumable, results as JSON.

A part is what a user would start: `sim-boats`, `referee` and one `deploy` (or one per boat), as processes of their own.
What is judged is the truth of the simulation, by the oracle; nothing the runner believes counts. Rammers hunt our boats
in some, while faults of every kind act on one boat of ours after the other.

STEERCLEAR_STUDY_DIR says where parts are kept (results/boats), STEERCLEAR_STUDY_MINUTES how long each is (5).
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from steerclear.env.record import load
from steerclear.experiments.deploy.demo import PORTS, Demo, free_ports
from steerclear.experiments.deploy.proof import Prover
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet

pytestmark = pytest.mark.study
STUDIES = Path(os.environ.get("STEERCLEAR_STUDY_DIR", "results/boats"))
"""Where parts are kept; one that is there is not played again."""
MINUTES = float(os.environ.get("STEERCLEAR_STUDY_MINUTES", "5"))
UNHEEDED = """
import dataclasses
from steerclear.experiments.cli import main
from steerclear.shield import Shield
from steerclear.shield.bridge import control_loop
class Unheeded(Shield):
    def decide(self, fleet, wanted, surroundings=None):
        return dataclasses.replace(super().decide(fleet, wanted, surroundings), filtered=wanted)
control_loop.Shield = Unheeded
main()
"""
"""``steerclear`` with a shield nobody heeds, for comparison on simulated boats alone."""
START_S, JUDGE_S, LATE_S = 300.0, 300.0, 120.0
ACCEPTED = ("drill", "latency", "rates", "spread")
"""Checks that a busy machine may fail, and the drill."""
ROUND_S = 1e-6
FIRST_S, EVERY_S = 45.0, 12.0
KINDS = (
    "telemetry_stop:4", "freeze:8", "jump:8", "late:8", "out_of_order:8", "duplicate:8", "corrupt:8", "link_loss:2",
    "commands_lost:2", "telemetry_stop:9", "link_loss:9",
)  # fmt: skip
DEAF = ("telemetry_stop", "link_loss", "commands_lost", "mode")
"""Nothing reaches the boat, or nobody knows where it is: what remains may not suffice."""


@dataclasses.dataclass(frozen=True)
class Part:
    """One stretch of play; ``faults`` are those of `sim-boats --fault`, at s since its start."""

    name: str
    platform: str = "heron"
    policy: str = "medium"
    opponents: str = "medium"
    minutes: float = MINUTES
    seed: int = 0
    shielded: bool = True
    per_boat: bool = False
    faults: tuple[str, ...] = ()


def mixed(minutes):
    """One fault every 12 s, the boats in turn; at the end a pilot puts one into HOLD and leaves it there."""
    boats, kinds = itertools.cycle(("blue_1", "blue_2", "blue_3")), itertools.cycle(KINDS)
    times_s = np.arange(FIRST_S, FIRST_S + 60.0 * minutes - 70.0 + 1e-9, EVERY_S).tolist()
    plan = [(at_s, next(boats), *next(kinds).split(":")) for at_s in times_s]
    faults = [f"{boat}:{name}@{at_s:g}+{lasts_s}" for at_s, boat, name, lasts_s in plan]
    return (*faults, f"blue_3:mode@{FIRST_S + EVERY_S * len(faults):g}")


PARTS = [
    Part("heron_medium", "heron", "medium", "medium", seed=1),
    Part("heron_rammers", "heron", "medium", "rammer", seed=2),
    Part("heron_attack", "heron", "medium_attack", "hard", seed=3),
    Part("surveyor_medium", "surveyor", "medium", "medium", seed=4),
    Part("surveyor_rammers", "surveyor", "medium", "rammer", seed=5),
    Part("surveyor_attack", "surveyor", "medium_attack", "hard", seed=6),
]
UNSHIELDED = [
    dataclasses.replace(part, name=f"{part.name}_unshielded", shielded=False, minutes=min(1.0, MINUTES))
    for part in PARTS
]
FAULTY = [
    Part("faults_team", opponents="rammer", seed=11, faults=mixed(MINUTES)),
    Part("faults_surveyor", "surveyor", opponents="rammer", seed=12, faults=mixed(MINUTES)),
    Part("per_boat", opponents="rammer", seed=13, per_boat=True),
    Part("per_boat_faults", opponents="rammer", seed=14, per_boat=True, faults=mixed(MINUTES)),
]


def played(part, folder):
    """The part's result: kept, or played now."""
    path, settings = STUDIES / f"{part.name}.json", json.loads(json.dumps(dataclasses.asdict(part)))
    if path.exists() and (kept := json.loads(path.read_text()))["part"] == settings:
        return kept
    result = {"part": settings, **play(part, folder)}
    STUDIES.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=1) + "\n")
    return result


def play(part, folder):
    """Play a part now; what really happened, and of each runner its figures and what its log proves."""
    fleet_file = write_fleet(part, folder)
    more = ["--record", str(folder / "truth.npz"), "--json", str(folder / "boats.json"), "--seed", str(part.seed)]
    more += [word for fault in part.faults for word in ("--fault", fault)]
    load_before = os.getloadavg()[0]
    with Demo(fleet_file, part.opponents, more=more) as water:
        water.wait(START_S)
        names = [boat.name for boat in load_fleet(fleet_file).boats if boat.link is not None] if part.per_boat else [""]
        runners = [runner(part, fleet_file, name) for name in names]
        end = time.monotonic() + START_S + 60.0 * part.minutes + LATE_S
        try:
            for process in runners:
                process.wait(max(1.0, end - time.monotonic()))
        finally:
            for process in runners:
                process.kill()
                process.wait()
        water.close(JUDGE_S)
    texts = "\n".join(path.read_text() for path in sorted(folder.glob("runner*.txt")))
    assert [process.returncode for process in runners] == [0] * len(runners), texts
    outcomes = [json.loads(path.read_text()) for path in sorted(folder.glob("runner*.json"))]
    truth, record = json.loads((folder / "boats.json").read_text()), load(folder / "truth.npz")
    meta, steps = json.loads(str(record["meta"])), int(np.flatnonzero(record["commanded"].any(axis=1)).max(initial=0))
    team, at = np.asarray(meta["team"]), record["position"][: steps + 2]
    return {
        "minutes_played": (steps + 1) * float(meta["dt_s"]) / 60.0,
        "closest_mate_m": closest(at, team, 0, 0),
        "closest_opponent_m": closest(at, team, 0, 1),
        **{key: truth[key] for key in ("captures", "tags", "let_go_s", "violations")},
        "load_average_before": load_before,
        "load_average_after": os.getloadavg()[0],
        "runners": [{**outcome["figures"], **contract_of(Path(outcome["log"]))} for outcome in outcomes],
    }


def write_fleet(part, folder):
    """The demonstration's file with other boats, on free ports."""
    text = demo_text().replace("platform: heron", f"platform: {part.platform}")
    ports = free_ports(len(PORTS) + 4)
    if part.per_boat:
        text = text.replace("coordination: team", "coordination: per_boat")
        for boat in (2, 3):  # each boat its own wire and ear; the first keeps the file's
            link = f'"udpin:127.0.0.1:{PORTS[0]}", system_id: {boat}}}'
            own = f'"udpin:127.0.0.1:{ports[boat + 1]}", system_id: {boat}}}'
            text = text.replace(link, f'{own}, feed_listen: "127.0.0.1:{ports[boat + 3]}"')
    for port, free in zip(PORTS, ports, strict=False):
        text = text.replace(f"127.0.0.1:{port}", f"127.0.0.1:{free}")
    path = folder / "FLEET.yaml"
    path.write_text(text)
    return path


def runner(part, fleet_file, boat):
    """A runner without its screen."""
    folder = fleet_file.parent
    program = ["-m", "steerclear.experiments.cli"] if part.shielded else ["-c", UNHEEDED]
    command = [sys.executable, *program, "deploy", str(fleet_file), "--plain", "--wait", f"{START_S:g}"]
    command += ["--policy", part.policy, "--minutes", f"{part.minutes:g}", "--seed", str(part.seed)]
    command += ["--json", str(folder / f"runner{boat}.json"), *(f"--accept={name}" for name in ACCEPTED)]
    command += ["--boat", boat] if boat else []
    with (folder / f"runner{boat}.txt").open("wb") as out:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)


def closest(at, team, first, second):
    """Closest approach of two boats of those teams, m."""
    pairs = itertools.product(np.flatnonzero(team == first), np.flatnonzero(team == second))
    return float(min(np.hypot(*(at[:, i] - at[:, j]).T).min() for i, j in pairs if first != second or i < j))


def contract_of(path):
    """Of a log: whether every command rests on fresh information or has its declared answer; and its replay."""
    with LogReader(path) as log:
        limits = parse_fleet(log.header.fleet_text).limits
        prover, broken = Prover(log.header), 0
        for tick in log.ticks():
            prover.add(tick)
            broken += stale(tick, limits)
    proof = prover.proof
    return {
        "commands_without_answer": broken,
        "decisions": proof.decisions,
        "decided_the_same": proof.same,
        "decided_otherwise": proof.different,
    }


def stale(tick, limits):
    """How much of what a tick's commands rested on was older than its limit, without the declared answer in effect."""
    told = {(action.subject, action.condition) for action in tick.actions}
    if tick.fleet is None or ("all", "end") in told or ("all", "stop_all") in told:
        return 0
    found = 0
    for name, reading in tick.readings.items():
        excused = {(name, "navigation"), (name, "link"), (name, "mode")} & told
        found += reading.age_s > limits.navigation.max_age_s + ROUND_S and not excused
        found += tick.policy_age_s > limits.policy.max_age_s + ROUND_S and (name, "policy") not in told
    for name, age_s in zip(tick.fleet.names, tick.fleet.age_s, strict=True):
        late = name not in tick.readings and age_s > limits.contact.max_age_s + ROUND_S
        found += late and (name, "contact") not in told
    return found


def circumstance(violation):
    """What held our boats when it happened."""
    if violation["after_run"]:
        return "after the run"
    return "nobody steered it" if max(violation["unsteered_s"]) > 0.0 else "+".join(violation["faults"]) or "no fault"


def show(capsys, *results):
    """A line each for a person, with violations, and the minutes with and without the shield."""
    lines = [""]
    for result in results:
        runners, part = result["runners"], result["part"]
        worst = {key: 1e3 * max(r[key] for r in runners) for key in ("jitter_p999_s", "read_to_sent_p99_s")}
        keys = ("commands_without_answer", "decided_the_same", "decisions")
        stale, same, decisions = (sum(r[key] for r in runners) for key in keys)
        lines.append(
            f"{part['name']}: {result['minutes_played']:.1f} min, shield {part['shielded']}, mates "
            f"{result['closest_mate_m']:.2f} m, opponents {result['closest_opponent_m']:.2f} m, "
            f"{len(result['violations'])} violations, jitter p99.9 {worst['jitter_p999_s']:.1f} ms, read to sent p99 "
            f"{worst['read_to_sent_p99_s']:.1f} ms, load {result['load_average_after']:.1f}, {stale} stale commands, "
            f"{same} of {decisions} replayed the same"
        )
        kinds = Counter(
            (circumstance(violation), violation["kind"], violation["verdict"]) for violation in result["violations"]
        )
        lines += [f"   {number} x {', '.join(what)}" for what, number in sorted(kinds.items())]
    with capsys.disabled():
        sys.stdout.write("\n".join(lines) + "\n")


@pytest.mark.parametrize("part", [*PARTS, *FAULTY], ids=lambda part: part.name)
def test_three_against_three(part, tmp_path, capsys):
    """No violation of teammates, no avoidable one with opponents, every command within the freshness contract.

    With faults: none while a boat hears us and is known.
    """
    result = played(part, tmp_path)
    show(capsys, result)
    during = [violation for violation in result["violations"] if not violation["after_run"]]
    if part.faults:
        during = [b for b in during if not set(b["faults"]) & set(DEAF) and circumstance(b) != "nobody steered it"]
    assert [
        violation for violation in during if violation["kind"] == "teammate" or violation["verdict"] != "unavoidable"
    ] == []
    assert all(runner["commands_without_answer"] == runner["decided_otherwise"] == 0 for runner in result["runners"])
    assert part.faults or all(runner["decisions"] > 500 * part.minutes for runner in result["runners"])


def test_without_the_shield_the_same_policies_come_too_near_ten_times_as_often(tmp_path, capsys):
    """The sum over all parts, those played above and those in which nobody heeds the shield."""
    results = []
    for part in (*PARTS, *UNSHIELDED):
        (tmp_path / part.name).mkdir()
        results.append(played(part, tmp_path / part.name))
    show(capsys, *results)
    assert all(result["minutes_played"] > 0.5 * result["part"]["minutes"] for result in results)
    rates = {}
    for shielded in (True, False):
        chosen = [result for result in results if result["part"]["shielded"] == shielded]
        violations = sum(not violation["after_run"] for result in chosen for violation in result["violations"])
        rates[shielded] = violations / sum(result["minutes_played"] for result in chosen)
    assert rates[True] < 0.1 * rates[False]
