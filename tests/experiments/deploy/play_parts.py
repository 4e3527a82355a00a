"""Parts of long studies on simulated boats over loopback MAVLink, each kept as JSON so that a study can go on.

A part is what a user would start: `sim-boats`, `referee` and one `deploy` (or one per boat), as processes of their own,
in real time. What is judged is the truth of the simulation, by the oracle; nothing the runner believes counts.
"""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from steerclear.env.record import load
from steerclear.experiments.deploy.demo import PORTS, Demo, free_ports
from steerclear.experiments.deploy.proof import Prover
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield.bridge.blackbox import LogReader
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet

STUDIES = Path(os.environ.get("STEERCLEAR_STUDY_DIR", "results/boats"))
"""Where parts are kept; one that is there is not played again."""
UNHEEDED = Path(__file__).with_name("unheeded_deploy.py")
START_S, JUDGE_S, LATE_S = 300.0, 300.0, 120.0
ACCEPTED = ("drill", "latency", "rates", "spread")
"""Checks that a busy machine may fail, and the drill."""
ROUND_S = 1e-6


@dataclasses.dataclass(frozen=True)
class Part:
    """One stretch of play.

    ``faults`` are those of `sim-boats --fault`, at s since its start.
    """

    name: str
    platform: str = "heron"
    policy: str = "medium"
    opponents: str = "medium"
    minutes: float = 5.0
    seed: int = 0
    shielded: bool = True
    per_boat: bool = False
    faults: tuple[str, ...] = ()


def played(part: Part, folder: Path) -> dict:
    """The part's result: kept, or played now."""
    path = STUDIES / f"{part.name}.json"
    settings = json.loads(json.dumps(dataclasses.asdict(part)))
    if path.exists():
        kept = json.loads(path.read_text())
        if kept["part"] == settings:
            return kept
    result = {"part": settings, **play(part, folder)}
    STUDIES.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=1) + "\n")
    return result


def play(part: Part, folder: Path) -> dict:
    """Play a part now."""
    fleet_file = write_fleet(part, folder)
    fleet = load_fleet(fleet_file)
    more = ["--record", str(folder / "truth.npz"), "--json", str(folder / "boats.json"), "--seed", str(part.seed)]
    more += [word for fault in part.faults for word in ("--fault", fault)]
    load_before = os.getloadavg()[0]
    with Demo(fleet_file, part.opponents, more=more) as water:
        water.wait(START_S)
        names = [boat.name for boat in fleet.boats if boat.link is not None] if part.per_boat else [""]
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
    logs = [contract_of(Path(outcome["log"])) for outcome in outcomes]
    truth = json.loads((folder / "boats.json").read_text())
    return {
        **judged(truth, load(folder / "truth.npz"), load_before),
        "runners": [{**outcome["figures"], **log} for outcome, log in zip(outcomes, logs, strict=True)],
    }


def write_fleet(part: Part, folder: Path) -> Path:
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


def runner(part: Part, fleet_file: Path, boat: str) -> subprocess.Popen:
    """A runner without its screen."""
    folder = fleet_file.parent
    program = ["-m", "steerclear.experiments.cli"] if part.shielded else [str(UNHEEDED)]
    command = [sys.executable, *program, "deploy", str(fleet_file), "--plain", "--wait", f"{START_S:g}"]
    command += ["--policy", part.policy, "--minutes", f"{part.minutes:g}", "--seed", str(part.seed)]
    command += ["--json", str(folder / f"runner{boat}.json"), *(f"--accept={name}" for name in ACCEPTED)]
    command += ["--boat", boat] if boat else []
    with (folder / f"runner{boat}.txt").open("wb") as out:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)


def judged(truth: dict, record: dict, load_before: float) -> dict:
    """What really happened: closest distances while boats were commanded, breaches of ours with what held them."""
    meta = json.loads(str(record["meta"]))
    steps = int(np.flatnonzero(record["commanded"].any(axis=1)).max(initial=0)) + 1
    team, at = np.asarray(meta["team"]), record["position"][: steps + 1]
    return {
        "minutes_played": steps * float(meta["dt_s"]) / 60.0,
        "closest_mate_m": closest(at, team, 0, 0),
        "closest_opponent_m": closest(at, team, 0, 1),
        "captures": truth["captures"],
        "tags": truth["tags"],
        "let_go_s": truth["let_go_s"],
        "breaches": truth["breaches"],
        "load_average_before": load_before,
        "load_average_after": os.getloadavg()[0],
    }


def closest(at, team, first: int, second: int) -> float:
    """Closest approach of two boats of those teams, m."""
    pairs = [
        (i, j)
        for i in np.flatnonzero(team == first)
        for j in np.flatnonzero(team == second)
        if (i < j if first == second else True)
    ]
    return float(min(np.hypot(*(at[:, i] - at[:, j]).T).min() for i, j in pairs))


def contract_of(path: Path) -> dict:
    """Of a log: whether every command rests on fresh information or has its declared answer; and its replay."""
    with LogReader(path) as log:
        limits = parse_fleet(log.header.fleet_text).limits
        prover, broken = Prover(log.header), 0
        for tick in log.ticks():
            prover.add(tick)
            broken += len(stale(tick, limits))
    proof = prover.proof
    return {
        "commands_without_answer": broken,
        "decisions": proof.decisions,
        "decided_the_same": proof.same,
        "decided_otherwise": proof.different,
    }


def stale(tick, limits) -> list[str]:
    """What a tick's commands rested on that was older than its limit without the declared answer in effect."""
    found = []
    told = {(action.subject, action.condition) for action in tick.actions}
    if tick.fleet is None or ("all", "end") in told or ("all", "stop_all") in told:
        return found
    for name, reading in tick.readings.items():
        excused = {(name, "navigation"), (name, "link"), (name, "mode")} & told
        if reading.age_s > limits.navigation.max_age_s + ROUND_S and not excused:
            found.append(f"{name}: navigation {reading.age_s:.2f} s")
        if tick.policy_age_s > limits.policy.max_age_s + ROUND_S and (name, "policy") not in told:
            found.append(f"{name}: policy {tick.policy_age_s:.2f} s")
    for name, age_s in zip(tick.fleet.names, tick.fleet.age_s, strict=True):
        if name not in tick.readings and age_s > limits.contact.max_age_s + ROUND_S and (name, "contact") not in told:
            found.append(f"{name}: contact {age_s:.2f} s")
    return found


def circumstance(breach: dict) -> str:
    """What held our boats when it happened."""
    if breach["after_run"]:
        return "after the run"
    if max(breach["unsteered_s"]) > 0.0:
        return "nobody steered it"
    return "+".join(breach["faults"]) or "no fault"


def summary(results: list[dict]) -> str:
    """Lines for a person: a part each, and the sum of those with and without the shield."""
    lines = []
    for result in results:
        part, runners = result["part"], result["runners"]
        worst = {key: 1e3 * max(r[key] for r in runners) for key in ("jitter_p999_s", "read_to_sent_p99_s")}
        counts = {
            key: sum(r[key] for r in runners) for key in ("commands_without_answer", "decided_the_same", "decisions")
        }
        lines.append(
            f"{part['name']}: {result['minutes_played']:.1f} min, mates {result['closest_mate_m']:.2f} m, opponents "
            f"{result['closest_opponent_m']:.2f} m, {len(result['breaches'])} breaches, jitter p99.9 "
            f"{worst['jitter_p999_s']:.1f} ms, read to sent p99 {worst['read_to_sent_p99_s']:.1f} ms, load "
            f"{result['load_average_after']:.1f}, {counts['commands_without_answer']} stale commands, "
            f"{counts['decided_the_same']} of {counts['decisions']} replayed the same"
        )
        kinds = Counter((circumstance(breach), breach["kind"], breach["verdict"]) for breach in result["breaches"])
        lines += [f"   {number} x {', '.join(what)}" for what, number in sorted(kinds.items())]
    for shielded in (True, False):
        chosen = [result for result in results if result["part"]["shielded"] == shielded]
        during = [breach for result in chosen for breach in result["breaches"] if not breach["after_run"]]
        minutes = sum(result["minutes_played"] for result in chosen)
        kinds = Counter((breach["kind"], breach["verdict"]) for breach in during)
        lines.append(
            f"{'shielded' if shielded else 'unshielded'}: {minutes:.1f} min, breaches during runs: {dict(kinds)}"
        )
    return "\n".join(lines)
