"""Ablation from Python: the same games without the shield and with it, from the same seeds."""

from dataclasses import replace

from steerclear.experiments.play.match import play_match
from steerclear.experiments.play.spec import MatchSpec

GAMES, LENGTH_S = 2, 60.0
off = MatchSpec("aamas2024", own="medium", opponent="rammer", rules={"max_time_s": LENGTH_S})
on = replace(off, shield={"profile": "ramming"})
for name, spec in (("off", off), ("on", on)):
    rows = [play_match(replace(spec, game=k, seed=k)).row for k in range(GAMES)]
    hits = sum(row["breaches_opponent_2.5m"] + row["breaches_teammate_2.5m"] for row in rows)
    print(f"shield {name}: {hits} hits at 2.5 m in {GAMES} games")
