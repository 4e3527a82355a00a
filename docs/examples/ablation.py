"""Ablation from Python: the same games without the shield and with it, and a figure of your own."""

from dataclasses import replace

from steerclear.experiments.play.match import play_match
from steerclear.experiments.play.spec import MatchSpec

GAMES, LENGTH_S, BLUE = 2, 60.0, slice(0, 3)


def mean_speed_mps(record):
    """Of our boats; `steerclear.env.record_file.ARRAYS` says what a record holds, by step and boat."""
    return record["speed_mps"][:, BLUE].mean()


off = MatchSpec("aamas2024", own="medium", opponent="rammer", rules={"max_time_s": LENGTH_S})
on = replace(off, shield={"profile": "ramming"})
for name, spec in (("off", off), ("on", on)):
    games = [play_match(replace(spec, game=k, seed=k)) for k in range(GAMES)]
    hits = sum(game.row["violations_opponent_2.5m"] + game.row["violations_teammate_2.5m"] for game in games)
    speed = sum(mean_speed_mps(game.record) for game in games) / GAMES
    print(f"shield {name}: {hits} hits at 2.5 m in {GAMES} games, mean speed {speed:.2f} m/s")
