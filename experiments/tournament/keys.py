"""Every key of the JSON and tables of a tournament, with its meaning and unit."""

from __future__ import annotations

from ..metrics import GOAL_KEYS

_LIMITS = {"value": "figure", "low": "lower 95 % limit; null where there is none", "high": "upper 95 % limit"}
_SIDE = {
    "shielded": "whether that side had a shield",
    "captures": "flags captured",
    "grabs": "flags grabbed",
    "tags": "tags made",
    "collisions": "as the score counts them: entries into the sum of the agent radii, for each boat of the side in it",
    "hits_teammate": "entries of two boats of the side into the separation radius",
    "hits_opponent": "entries of a boat of the side and an opponent into it",
    "closest_m": "closest distance of a boat of the side to any other, m",
    "avoidable_teammate": "hits of team-mates that own commands could have avoided; null when not judged",
    "avoidable_opponent": "the same with opponents",
    "changed_share": "share of its boat-steps whose command the shield changed, 0 to 1; null without a shield",
    "deadlocks": "pairs of its boats that want to move and stood still for over 10 s",
    "failures": "times its policy raised or answered nonsense, or was gone; its boats held",
    "usable_steps": "steps in which its policy gave some boat a usable answer",
    "first_failure": "text of the first failure",
    "missed_deadlines": "plans of a planner that came too late",
    "think_p95_ms": "95th percentile of the time a plan took, ms; null for teams that make none",
}
TOURNAMENT_GAME = {
    "phase": "qualifying or final",
    "state": "which teams were shielded: off, all, or names",
    "examined": "side of the team whose qualifying game it is; empty in the final",
    "blue": "team on the left",
    "red": "team on the right",
    "repetition": "number; the same in all pairs, on both sides and in all states starts from the same seed",
    "seed": "of start places and policies",
    "preset": "rules of the game",
    "steps": "steps played",
    "duration_s": "game time played, s",
    "wall_s": "time it took to play and judge, s",
    **{f"{side}_{name}": f"{words}, {side} side" for side in ("blue", "red") for name, words in _SIDE.items()},
}
_STANDING = {
    "team": "name",
    "rank": "by score, equal scores share the best",
    "score": "captures for minus against, minus the penalty for collisions; per double round robin, as all of these",
    "score_0.25": "with that penalty",
    "score_0.025": "with that penalty",
    "net_captures": "captures for minus against: the score without penalty",
    "rank_free": "rank by it",
    "captures": "flags captured",
    "captures_against": "by opponents",
    "grabs": "flags grabbed",
    "grabs_against": "by opponents",
    "tags": "tags made",
    "tags_against": "times tagged",
    "collisions": "as the score counts them",
    "hits_teammate": "entries of two of its boats into the separation radius",
    "hits_opponent": "of one of its boats and an opponent",
    **{
        f"{name}_{end}": f"{word} 95 % limit of it; null with one repetition"
        for name in ("rank", "score", "net_captures", "collisions")
        for end, word in (("low", "lower"), ("high", "upper"))
    },
}
_AGREEMENT = {
    "teams[]": "teams that are in both rankings",
    **{f"kendall.{k}": f"Kendall's tau-b, {v}" for k, v in _LIMITS.items()},
    **{f"spearman.{k}": f"Spearman's rho, {v}" for k, v in _LIMITS.items()},
    "disagree[]": "pairs in our order that the paper has the other way round",
    "sure[]": "of each such pair: share of resamples that have it so; null with one repetition",
}
_PRICE = {
    "team": "name",
    "games": "games played both off and on from the same seed",
    "net_captures_off": "net captures per game, off",
    "net_captures_on": "on",
    **{f"net_captures.{k}": f"change of net captures per game, on - off, paired: {v}" for k, v in _LIMITS.items()},
    **{f"captures_kept.{k}": f"captures on / off, paired: {v}" for k, v in _LIMITS.items()},
    "hits_off": "hits per game, off",
    "hits_on": "on",
    **{f"hits.{k}": f"change of hits per game, on - off, paired: {v}" for k, v in _LIMITS.items()},
    "kept": "whether net captures stay at 95 % or more of those without",
    **{f"margin.{k}": f"net captures per game above those 95 %, paired: {v}" for k, v in _LIMITS.items()},
    "judged": "shielded games that were judged",
    "avoidable": "avoidable hits in them; null when none was judged",
    "avoidable_per_game": "null when none was judged",
    **{f"avoidable_per_game.{k}": f"avoidable hits per judged game: {v}" for k, v in _LIMITS.items()},
    "avoidable_share": "share of its hits in judged games that were avoidable; null without hits",
}
TOURNAMENT = {
    "command": "which command wrote this",
    "complete": "false when interrupted or a game could not be played",
    "settings.*": "settings as given on the command line",
    "versions.*": "versions of Python and packages",
    "machine.*": "processor, cores, memory, system",
    "wall_s": "how long it took, s",
    "games_played": "games in the results",
    "games_resumed": "of those, how many an earlier run had played",
    **{f"failed[].{k}": f"{k} of a game that could not be played" for k in ("phase", "state", "blue", "red")},
    "failed[].repetition": "its number",
    "failed[].error": "why",
    "failed[].fault": "whether that is a fault of steerclear, not of what was given",
    "warnings[]": "teams whose code failed, forfeited moves or missed deadlines",
    "silent[]": "teams that gave nothing usable throughout a game: the exit status is 2",
    "qualifying[].team": "name",
    "qualifying[].state": "which teams were shielded",
    "qualifying[].games": "games against easy, medium and hidden",
    "qualifying[].score": "mean score per game",
    "qualifying[].captures": "captures in all of them",
    "states[].state": "which teams were shielded",
    "states[].games": "games of the final",
    "states[].repetitions": "repetitions that all pairs have played: those the tables count",
    **{f"states[].standings[].{k}": v for k, v in _STANDING.items()},
    "states[].teams[]": "order of the rows and columns below",
    "states[].wins[][]": "share of games that the row's team won against the column's, a draw half; null: none",
    "states[].alpha_rank.*[]": "alpha-rank of each team at that strength of selection",
    "states[].cycles[]": "three teams each of which beats the next",
    "states[].table_3": "agreement with the paper's Table 3; null with fewer than three of its teams",
    "states[].table_4": "agreement with the paper's Table 4, penalty off",
    **{f"states[].table_{n}.{k}": v for n in (3, 4) for k, v in _AGREEMENT.items()},
    **{
        f"states[].table_{n}.scripted.{games}.{k}": f"{v}; scripted teams alone{words}"
        for n in (3, 4)
        for games, words in (("all_games", ""), ("among", ", of the games among them"))
        for k, v in _AGREEMENT.items()
    },
    **{f"states[].table_{n}.scripted": "null with fewer than three scripted teams" for n in (3, 4)},
    **{f"prices[].{k}": v for k, v in _PRICE.items()},
    **GOAL_KEYS,
    "files.*": "what was written, relative to the folder",
}
