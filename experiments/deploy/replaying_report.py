"""What a replay found, as numbers: the proof, distances and breaches with and without the shield, verdicts."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from steerclear.env.record import Record
from steerclear.shield.bridge.blackbox import ChainCheck, LogHeader, LogLine, LogReader
from steerclear.shield.bridge.blackbox.header import describe_machine, source_digest, table_digests, versions

from ..game_metrics import PairDistances
from ..verdicts import NOT_JUDGED, judge_game
from .replaying import Proof, Prover
from .replaying_record import placed, record_of
from .replaying_tracks import TrackBuilder, Tracks
from .replaying_without import Without, sail_without

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
        """Whether every decision of a log that is as it was written is proved.

        Logs of version 1 have no chain, and one that was killed has no end: that is told, and they count as they are.
        """
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
    """A breach nobody judged, with the keys of `keys.BREACH`."""
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
    """The report as JSON-ready content, see `replay_keys.REPLAY`."""
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
