"""What a replay found, on the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from .replaying import Difference
from .replaying_report import Replay

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
    if not chain.chained:
        console.print(f"The log is not chained ({replay.made_by}): what was cut out or changed does not show.")
        return
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
        ("closest_teammate_m", "closest team-mate, m"),
        ("closest_opponent_m", "closest other boat, m"),
        ("breaches_teammate", "breaches with team-mates"),
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
