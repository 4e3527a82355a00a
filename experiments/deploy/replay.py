"""Result of a replay: the proof, and on demand distances and separation violations with verdicts; as data and text."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from types import SimpleNamespace
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text
from steerclear.env.record import Record
from steerclear.shield.bridge.blackbox import ChainCheck, LogHeader, LogLine, LogReader
from steerclear.shield.bridge.blackbox.header import describe_machine, source_digest, table_digests, versions

from ..game_metrics import PairDistances
from ..verdicts import judge_game
from ..words import count_text
from .proof import Difference, Proof, Prover
from .tracks import TrackBuilder, Tracks, placed, record_of

MOST_LINES = 200  # most log lines in the report
MOST_ROWS = 12  # most rows of a table; the rest is only counted


@dataclass
class Replay:
    """Result of a replay, see `docs.KEYS`."""

    header: LogHeader
    proof: Proof
    complete: bool
    chain: ChainCheck
    damage: list[str]
    began: str
    seconds: float
    reasons: Counter[str]
    actions: Counter[tuple[str, str, str]]
    lines: list[LogLine]  # warnings and errors in the log
    origin: list[str]
    tracks: Tracks | None = None  # trajectories; None if not requested
    record: Record | None = None  # of the game, made from the tracks
    # closest distances, m, and separation violations with counts and verdicts; empty if not requested
    judged: dict[str, Any] = field(default_factory=dict)

    @property
    def proved(self) -> bool:
        """Whether every decision is proved and the log is intact; a log without a proper end can be proved."""
        return self.proof.proved and self.chain.broken == 0 and not self.damage

    @property
    def made_by(self) -> str:
        """Version that wrote the log."""
        return f"steerclear {self.header.versions.get('steerclear', 'unknown')}, sources {self.header.sources[:8]}"


def replay_log(log: LogReader, keep_tracks: bool) -> Replay:
    """Decide everything in a log again; ``keep_tracks`` also builds tracks and record.

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
        reasons.update(d.reason.name for d in entry.decisions or () if d.reason.name != "NOT_COVERED")
        if keep_tracks:
            builder.add(entry)
    tracks = builder.finish() if keep_tracks else None
    return Replay(
        header=log.header,
        proof=prover.proof,
        complete=log.complete,
        chain=log.chain,
        damage=log.damage,
        began=time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(log.header.unix_ns / 1e9)),
        seconds=last_s - log.header.clock_s,
        reasons=reasons,
        actions=actions,
        lines=lines,
        origin=origin_of(log.header),
        tracks=tracks,
        record=None if tracks is None else record_of(log.header, tracks),
    )


def origin_of(header: LogHeader) -> list[str]:
    """List differences between the log's program and this one that may change the last bits."""
    here = versions()
    found = [
        f"{name} {header.versions.get(name, 'none')} there, {here.get(name, 'none')} here"
        for name in sorted({*header.versions, *here})
        if header.versions.get(name) != here.get(name)
    ]
    if header.sources != source_digest():
        found.append("the sources of the shield are others")
    if dict(header.tables or {}) != table_digests(header.platforms):
        found.append("the value tables of these boats are others")
    if header.machine != describe_machine():
        found.append(f"machine {header.machine} there, {describe_machine()} here")
    return found


def judge(replay: Replay) -> None:
    """Add the own boats' closest distances and the verdicts on their separation violations."""
    tracks, record = replay.tracks, replay.record
    if tracks is None or record is None:
        return
    side = min(int(tracks.team[tracks.ours].min(initial=1)), 1)
    seen: Any = SimpleNamespace(states=placed(tracks.states), driven=tracks.marked("driven"))
    violations = judge_game(seen, tracks.params, record, side)
    distances = PairDistances.of(placed(tracks.states)[:, :, :2])
    for kind, wanted in (("teammate", 2), ("opponent", 1)):
        columns = [c for c, pair in enumerate(distances.pairs) if tracks.ours[list(pair)].sum() == wanted]
        gaps = distances.distance_m[:, columns]
        near = gaps[gaps < 1e5]
        replay.judged[f"closest_{kind}_m"] = float(near.min()) if near.size else None
        replay.judged[f"violations_{kind}"] = sum(violation["kind"] == kind for violation in violations)
    replay.judged["violations"] = violations


def as_content(replay: Replay) -> dict[str, Any]:
    """The report as JSON-ready content, see `docs.KEYS`."""
    proof = replay.proof
    shown = ("began", "seconds", "complete", "made_by", "proved", "damage", "origin")
    chain = ("chained", "keyed", "codes_checked", "broken", "breaks")
    return {
        **{name: getattr(replay, name) for name in shown},
        "policy": replay.header.policy,
        "chain": {name: getattr(replay.chain, name) for name in chain},
        **{name: count for name, count in asdict(proof).items() if name not in ("covered", "first")},
        "missing": [list(stretch) for stretch in proof.missing],
        "first_difference": proof.first and proof.first._asdict(),
        "first_sent": proof.first_sent and proof.first_sent._asdict(),
        "cut": [{"boat": boat, "limit_mps": limit, "commands": count} for (boat, limit), count in proof.cut.items()],
        "reasons": dict(replay.reasons),
        "actions": [
            {"condition": condition, "response": response, "subject": subject, "ticks": count}
            for (condition, response, subject), count in replay.actions.most_common()
        ],
        **replay.judged,
    }


def show(console: Console, replay: Replay) -> None:
    """Print the whole report."""
    for part in (*_log_lines(replay), *_chain_lines(replay), *_proof_lines(replay), *_tables(replay)):
        console.print(part)


def _rest(count: int) -> list[str]:
    return [f"  and {count - MOST_ROWS} more"] if count > MOST_ROWS else []


def _log_lines(replay: Replay) -> Iterator[RenderableType]:
    header = replay.header
    ours = [boat.name for boat in header.boats if boat.ours]
    whose = f", policy {header.policy}" * bool(header.policy) + f", own boats {', '.join(ours)}" * bool(ours)
    yield Text(f"{replay.began}, {replay.seconds:.1f} s, {count_text(replay.proof.ticks, 'turn')}{whose}")
    if replay.origin:
        yield Text(
            f"Made by {replay.made_by}. Not all is as here, and this program may decide otherwise:", style="yellow"
        )
        yield from (Text(f"  {text}") for text in replay.origin)
    if not replay.complete:
        yield "The log was not closed (crash, power or kill); read up to what was on the disk."
    yield from (Text(f"Damage: {text}.", style="red") for text in replay.damage)
    yield from (Text(f"  {line.name}: {line.text}") for line in replay.lines[:MOST_ROWS])
    yield from _rest(len(replay.lines))


def _chain_lines(replay: Replay) -> Iterator[RenderableType]:
    chain = replay.chain
    if chain.broken == 1 and chain.unkeyed:
        yield Text(f"Hash chain: {chain.breaks[0]}.", style="yellow")
        return
    if chain.of_another_key:
        text = "none of its codes is of this key: another key, or another writer; the chain itself holds"
        yield Text(f"Hash chain: {text}.", style="red")
        return
    if chain.broken:
        yield Text("Hash chain: damaged. The log is not as it was written:", style="red")
        yield from (Text(f"  {text}") for text in chain.breaks[:MOST_ROWS])
        yield from _rest(chain.broken)
        return
    codes = "It carries no codes: it shows damage, not who wrote it."
    if chain.codes_checked:
        codes = f"{chain.codes_checked} codes are of this key."
    elif chain.keyed:
        codes = "Its codes were not checked: give --key FILE, the key of the boats."
    yield f"Hash chain: verified{'' if replay.complete else ' up to where the log ends'}. {codes}"


def _proof_lines(replay: Replay) -> Iterator[RenderableType]:
    proof = replay.proof
    if proof.decisions == 0:
        yield Text("The log holds no decision of the shield: nothing is proved.", style="yellow")
    elif proof.different == 0 and proof.unproven == 0:
        yield Text(
            f"{proof.same} of {count_text(proof.decisions, 'decision')} made again, the same bit for bit.",
            style="green",
        )
    else:
        yield Text(
            f"{proof.same} of {count_text(proof.decisions, 'decision')} made again the same, {proof.different} differ, "
            f"{proof.unproven} differ after turns missing from the log and are not proved "
            f"({count_text(len(proof.missing), 'gap')}).",
            style="red" if proof.different else "yellow",
        )
    if proof.missing:
        lost = sum(after - before - 1 for before, after in proof.missing if after > before)
        back = sum(after <= before for before, after in proof.missing)
        text = count_text(lost, "turn is", "turns are") + " missing from the log"
        text += f", {count_text(back, 'time')} they go back" if back else ""
        yield Text(f"{text}: what was decided then is not proved.", style="yellow")
    if proof.first is not None:
        yield _first("First difference", proof.first, "recorded", "now")
    if proof.strayed or proof.unfounded:
        text = f"{count_text(proof.strayed, 'command is', 'commands are')} not what was decided, "
        text += f"{count_text(proof.unfounded, 'was', 'were')} sent without a decision."
        yield Text(text, style="red" if proof.strayed else "yellow")
    for (boat, limit_mps), count in proof.cut.items():
        yield Text(f"{boat}: its autopilot's limit of {limit_mps:g} m/s cut {count_text(count, 'command')}.")
    if proof.first_sent is not None:
        yield _first("First of them", proof.first_sent, "decided", "sent")
    if proof.holds and not replay.proved:
        yield Text("NOT PROVED.", style="yellow")
    total = sum(replay.reasons.values())
    shares = ", ".join(f"{name} {count / total:.1%}" for name, count in replay.reasons.most_common())
    yield Text(f"Reasons: {shares}" if total else "No boat was covered: nothing is proved.")


def _first(title: str, first: Difference, one: str, other: str) -> Text:
    where = f"turn {first.tick} at {first.time_s:.2f} s, {first.boat or 'all boats'}, {first.what}"
    return Text(f"{title}: {where}: {one} {first.recorded}, {other} {first.replayed}")


def _tables(replay: Replay) -> Iterator[RenderableType]:
    if replay.actions:
        table = Table("condition", "response", "subject", "turns", title="Declared and in effect", title_justify="left")
        for (condition, response, subject), count in replay.actions.most_common(MOST_ROWS):
            table.add_row(condition, response, subject, str(count))
        yield table
        yield from _rest(len(replay.actions))
    if not replay.judged:
        return
    table = Table("", "", title="Own boats", title_justify="left", show_header=False)
    for key, name in (
        ("closest_teammate_m", "closest teammate, m"),
        ("closest_opponent_m", "closest other boat, m"),
        ("violations_teammate", "violations with teammates"),
        ("violations_opponent", "violations with others"),
    ):
        table.add_row(name, _number(replay.judged[key]))
    yield table
    if violations := replay.judged["violations"]:
        title = f"Violations of {replay.header.config.separation_m:g} m"
        heads = ("time, s", "boats", "closest, m", "verdict", "last chance, s before", "responsible")
        table = Table(*heads, title=title, title_justify="left")
        for entry in violations[:MOST_ROWS]:
            row = [f"{entry['time_s']:.1f}", ", ".join(entry["boats"]), f"{entry['closest_m']:.2f}"]
            table.add_row(*row, entry["verdict"], _number(entry["last_preventable_s"]), entry["responsible"] or "-")
        yield table
        yield from _rest(len(violations))


def _number(value: Any) -> str:
    return "-" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
