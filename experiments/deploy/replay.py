"""What a replay found: the proof, distances, breaches and verdicts with and without the shield; as numbers and text."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from steerclear.env.record import Record
from steerclear.shield.bridge.blackbox import ChainCheck, LogHeader, LogLine, LogReader
from steerclear.shield.bridge.blackbox.header import describe_machine, source_digest, table_digests, versions

from ..game_metrics import PairDistances
from ..verdicts import NOT_JUDGED, judge_game
from .proof import Difference, Proof, Prover
from .tracks import TrackBuilder, Tracks, Without, placed, record_of, sail_without

MOST_LINES = 200
"""Lines of the log kept for the report."""


@dataclass
class Replay:
    """What a replay found.

    Attributes:
        header: of the log.
        proof: whether the shield decides the same.
        complete: whether the log was closed properly.
        chain: what the log's chain says.
        damage: what could not be read.
        began: when the log began, UTC.
        seconds: how long it is, s.
        reasons: how many decisions of own boats had each reason.
        actions: ticks in which each (condition, response, subject) was in effect.
        lines: warnings and errors in the log.
        origin: what differs between the machine and versions of the log and of this program.
        tracks, without: what happened and what would have happened; None where not asked for.
        records: of both.
        sides: closest distances, m, and breaches, by "with" and "without".
        breaches: with verdicts, by "with" and "without".
    """

    header: LogHeader
    proof: Proof
    complete: bool
    chain: ChainCheck
    damage: list[str]
    began: str
    seconds: float
    reasons: Counter[str]
    actions: Counter[tuple[str, str, str]]
    lines: list[LogLine]
    origin: list[str]
    tracks: Tracks | None = None
    without: Without | None = None
    records: list[Record] = field(default_factory=list)
    sides: dict[str, dict[str, Any]] = field(default_factory=dict)
    breaches: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    @property
    def proved(self) -> bool:
        """Whether every decision of a log that is as it was written is proved; one that was killed has no end."""
        return self.proof.proved and self.chain.broken == 0 and not self.damage

    @property
    def made_by(self) -> str:
        """Which version wrote the log."""
        return f"steerclear {self.header.versions.get('steerclear', 'unknown')}, sources {self.header.sources[:8]}"

    @property
    def is_by_another(self) -> bool:
        """Whether the log's program may decide otherwise than this one."""
        return bool(self.origin)


@dataclass(frozen=True)
class _Judged:
    """What the oracle looks back at."""

    states: Any
    driven: Any


def replay_log(log: LogReader, keep_tracks: bool) -> Replay:
    """Decide everything in a log again; keep tracks when they are needed afterwards.

    Raises:
        LogError: a part does not fit this version.
    """
    prover, builder = Prover(log.header), TrackBuilder(log.header)
    reasons: Counter[str] = Counter()
    actions: Counter[tuple[str, str, str]] = Counter()
    lines: list[LogLine] = []
    last_s = log.header.clock_s
    for entry in log.entries():
        if isinstance(entry, LogLine):
            if entry.level >= 3 and len(lines) < MOST_LINES:
                lines.append(entry)
            continue
        prover.add(entry)
        last_s = entry.began_s
        actions.update((action.condition, action.response, action.subject) for action in entry.actions)
        if entry.decisions is not None:
            reasons.update(d.reason.name for d in entry.decisions if d.reason.name != "NOT_COVERED")
        if keep_tracks:
            builder.add(entry)
    return Replay(
        header=log.header,
        proof=prover.proof,
        complete=log.complete and not log.chain.is_mended,
        chain=log.chain,
        damage=log.damage,
        began=time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(log.header.unix_ns / 1e9)),
        seconds=last_s - log.header.clock_s,
        reasons=reasons,
        actions=actions,
        lines=lines,
        origin=origin_of(log.header),
        tracks=builder.finish() if keep_tracks else None,
    )


def origin_of(header: LogHeader) -> list[str]:
    """What may change a last bit between the log's program and this one, in words."""
    found = [
        f"{name} {header.versions.get(name, 'none')} there, {versions().get(name, 'none')} here"
        for name in sorted({*header.versions, *versions()})
        if header.versions.get(name) != versions().get(name)
    ]
    if header.sources != source_digest():
        found.append("the sources of the shield are others")
    if dict(header.tables or {}) != table_digests(header.platforms):
        found.append("the value tables of these boats are others")
    if header.machine != describe_machine():
        found.append(f"machine {header.machine} there, {describe_machine()} here")
    return found


def draw(replay: Replay) -> None:
    """Fill in the record of what happened, distances and breaches."""
    if replay.tracks is not None:
        _add_side(replay, "with", "as it was", replay.tracks.states)


def compare(replay: Replay, judge: bool) -> None:
    """Fill in what would have happened without the shield, and what the oracle says of breaches that happened."""
    tracks = replay.tracks
    if tracks is None:
        return
    replay.without = sail_without(tracks, replay.header.config.delay_s)
    _add_side(replay, "without", "without the shield", replay.without.states)
    if judge:
        side = min(int(tracks.team[tracks.ours].min(initial=1)), 1)
        seen = _Judged(placed(tracks.states), tracks.driven)
        replay.breaches["with"] = judge_game(seen, tracks.params, replay.records[0], side)  # type: ignore[arg-type]


def _add_side(replay: Replay, side: str, title: str, states: Any) -> None:
    tracks = replay.tracks
    if tracks is None:
        return
    record = record_of(replay.header, tracks, states, title, shielded=side == "with")
    replay.records.append(record)
    replay.sides[side] = _distances(record, tracks, states)
    ours = [row for row in record["breaches"] if tracks.ours[[int(row[1]), int(row[2])]].any()]
    replay.breaches[side] = [_entry(row, tracks, replay.header.config.separation_m) for row in ours]


def _entry(row: Any, tracks: Tracks, radius_m: float) -> dict[str, Any]:
    """A breach nobody judged, with the keys of `docs_keys.BREACH`."""
    step, pair = int(row[0]), (int(row[1]), int(row[2]))
    both = bool(tracks.ours[list(pair)].all())
    return {
        "step": step,
        "time_s": step * tracks.dt_s,
        "boats": [tracks.names[boat] for boat in pair],
        "kind": "teammate" if both else "opponent",
        "radius_m": radius_m,
        "closest_m": float(row[3]),
        "verdict": NOT_JUDGED,
        "last_preventable_s": None,
        "other_last_preventable_s": None,
        "exhausted": None,
        "responsible": None,
        "responsible_boats": [],
    }


def _distances(record: Record, tracks: Tracks, states: Any) -> dict[str, Any]:
    """Closest distances, m, and numbers of breaches of own boats, by kind of pair; None without such a pair."""
    position, ours = placed(states)[:, :, :2], tracks.ours
    distances = PairDistances.of(position)
    found: dict[str, Any] = {}
    for kind, wanted in (("teammate", 2), ("opponent", 1)):
        columns = [c for c, pair in enumerate(distances.pairs) if ours[list(pair)].sum() == wanted]
        gaps = distances.distance_m[:, columns]
        near = gaps[gaps < 1e5]
        found[f"closest_{kind}_m"] = float(near.min()) if near.size else None
        both = [ours[[int(row[1]), int(row[2])]].sum() == wanted for row in record["breaches"]]
        found[f"breaches_{kind}"] = int(np.sum(both))
    return found


def as_content(replay: Replay) -> dict[str, Any]:
    """The report as JSON-ready content, see `keys.REPLAY`."""
    proof = replay.proof
    content: dict[str, Any] = {
        "began": replay.began,
        "seconds": replay.seconds,
        "policy": replay.header.policy,
        "complete": replay.complete,
        "made_by": replay.made_by,
        "proved": replay.proved,
        "chain": {
            "chained": replay.chain.chained,
            "keyed": replay.chain.keyed,
            "codes_checked": replay.chain.codes_checked,
            "mended": replay.chain.is_mended,
            "broken": replay.chain.broken,
            "breaks": replay.chain.breaks,
        },
        "damage": replay.damage,
        "origin": replay.origin,
        "ticks": proof.ticks,
        "decisions": proof.decisions,
        "same": proof.same,
        "different": proof.different,
        "unproven": proof.unproven,
        "missing": [list(stretch) for stretch in proof.missing],
        "first_difference": None if proof.first is None else asdict(proof.first),
        "strayed": proof.strayed,
        "unfounded": proof.unfounded,
        "cut": [{"boat": boat, "limit_mps": limit, "commands": count} for (boat, limit), count in proof.cut.items()],
        "first_sent": None if proof.first_sent is None else asdict(proof.first_sent),
        "reasons": dict(replay.reasons),
        "actions": [
            {"condition": condition, "response": response, "subject": subject, "ticks": count}
            for (condition, response, subject), count in replay.actions.most_common()
        ],
    }
    if replay.without is not None:
        content["stretches"] = replay.without.stretches
    content["sides"] = {side: {**found, "breaches": replay.breaches[side]} for side, found in replay.sides.items()}
    return content


MOST_ROWS = 12
"""Rows of a table; the rest is counted."""


def show(console: Console, replay: Replay) -> None:
    """Print the whole report."""
    _show_log(console, replay)
    _show_chain(console, replay)
    _show_proof(console, replay)
    _show_actions(console, replay)
    if replay.without is not None:
        _show_sides(console, replay)
        for side, title in (("with", "Breaches that happened"), ("without", "Breaches without the shield")):
            _show_breaches(console, title, replay.breaches[side])


def _show_log(console: Console, replay: Replay) -> None:
    header, proof = replay.header, replay.proof
    ours = [boat.name for boat in header.boats if boat.ours]
    console.print(
        f"{replay.began}, {replay.seconds:.1f} s, {proof.ticks} ticks"
        + (f", policy {header.policy}" if header.policy else "")
        + (f", own boats {', '.join(ours)}" if ours else "")
    )
    if replay.is_by_another:
        text = f"Made by {replay.made_by}. Not all is as here, and this program may decide otherwise:"
        console.print(text, style="yellow", markup=False)
        for text in replay.origin:
            console.print(f"  {text}", markup=False)
    if replay.chain.is_mended:
        console.print("The log was cut off (crash, power or kill) and mended; what followed is missing.")
    elif not replay.complete:
        console.print("The log was not closed (crash, power or kill); read up to what was on the disk.")
    for text in replay.damage:
        console.print(f"Damage: {text}.", style="red", markup=False)
    for line in replay.lines[:MOST_ROWS]:
        console.print(f"  {line.name}: {line.text}", markup=False)
    _rest(console, len(replay.lines))


def _show_chain(console: Console, replay: Replay) -> None:
    chain = replay.chain
    if chain.broken:
        console.print("The log is not as it was written:", style="red")
        for text in chain.breaks[:MOST_ROWS]:
            console.print(f"  {text}", markup=False)
        _rest(console, chain.broken)
    elif chain.keyed and not chain.codes_checked:
        console.print("Its chain holds. Its codes were not checked: give --key FILE, the key of the boats.")
    elif chain.codes_checked:
        console.print(f"Its chain holds, and {chain.codes_checked} codes are of this key.")


def _show_proof(console: Console, replay: Replay) -> None:
    proof = replay.proof
    if proof.decisions == 0:
        console.print("The log holds no decision of the shield: nothing is proved.", style="yellow")
    elif proof.different == 0 and proof.unproven == 0:
        console.print(f"{proof.same} of {proof.decisions} decisions made again, the same bit for bit.", style="green")
    else:
        console.print(
            f"{proof.same} of {proof.decisions} decisions are the same, {proof.different} differ, {proof.unproven} "
            f"differ after missing ticks and are not proved ({len(proof.missing)} gaps).",
            style="red" if proof.different else "yellow",
        )
    if proof.missing:
        lost = sum(after - before - 1 for before, after in proof.missing if after > before)
        back = sum(after <= before for before, after in proof.missing)
        text = f"{lost} turns are missing" + (f", {back} times they go back" if back else "")
        console.print(f"{text}: what was decided then is not proved.", style="yellow")
    if proof.first is not None:
        _show_first(console, "First difference", proof.first, "recorded", "now")
    if proof.strayed or proof.unfounded:
        text = f"{proof.strayed} commands are not what was decided, {proof.unfounded} were sent without a decision."
        console.print(text, style="red" if proof.strayed else "yellow")
    for (boat, limit_mps), count in proof.cut.items():
        console.print(f"{boat}: its autopilot's limit of {limit_mps:g} m/s cut {count} commands.", markup=False)
    if proof.first_sent is not None:
        _show_first(console, "First of them", proof.first_sent, "decided", "sent")
    if replay.proof.holds and not replay.proved:
        console.print("NOT PROVED.", style="yellow")
    total = sum(replay.reasons.values())
    shares = ", ".join(f"{name} {count / total:.1%}" for name, count in replay.reasons.most_common())
    console.print(f"Reasons: {shares}" if total else "No boat was covered: nothing is proved.")


def _show_first(console: Console, title: str, first: Difference, one: str, other: str) -> None:
    console.print(
        f"{title}: tick {first.tick} at {first.time_s:.2f} s, {first.boat or 'all boats'}, {first.what}: "
        f"{one} {first.recorded}, {other} {first.replayed}",
        markup=False,
    )


def _show_actions(console: Console, replay: Replay) -> None:
    if not replay.actions:
        return
    table = Table("condition", "response", "subject", "ticks", title="Declared and in effect", title_justify="left")
    for (condition, response, subject), count in replay.actions.most_common(MOST_ROWS):
        table.add_row(condition, response, subject, str(count))
    console.print(table)
    _rest(console, len(replay.actions))


def _show_sides(console: Console, replay: Replay) -> None:
    table = Table("", "with the shield", "without", title="Own boats", title_justify="left")
    sides = [replay.sides[side] for side in ("with", "without")]
    for key, name in (
        ("closest_teammate_m", "closest teammate, m"),
        ("closest_opponent_m", "closest other boat, m"),
        ("breaches_teammate", "breaches with teammates"),
        ("breaches_opponent", "breaches with others"),
    ):
        table.add_row(name, *(_number(side[key]) for side in sides))
    console.print(table)
    stretches = 0 if replay.without is None else replay.without.stretches
    console.print(
        f"Radius {replay.header.config.separation_m:g} m. Boats left their track {stretches} times to do what was "
        "wanted; others stay on theirs."
    )


def _show_breaches(console: Console, title: str, breaches: list[dict[str, Any]]) -> None:
    if not breaches:
        return
    judged = any(entry["responsible"] for entry in breaches)
    table = Table("time, s", "boats", "closest, m", title=title, title_justify="left")
    for name in ("verdict", "last chance, s before", "responsible") if judged else ():
        table.add_column(name)
    for entry in breaches[:MOST_ROWS]:
        row = [f"{entry['time_s']:.1f}", ", ".join(entry["boats"]), f"{entry['closest_m']:.2f}"]
        if judged:
            row += [entry["verdict"], _number(entry["last_preventable_s"]), entry["responsible"] or "-"]
        table.add_row(*row)
    console.print(table)
    _rest(console, len(breaches))


def _number(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _rest(console: Console, count: int) -> None:
    if count > MOST_ROWS:
        console.print(f"  and {count - MOST_ROWS} more")
