"""Keys of the JSON that `steerclear referee` writes, with meaning and unit."""

from __future__ import annotations

REFEREE = {
    "ended": "why: over, time or stopped",
    "faults.*": "packets and fixes refused, by kind",
    "events[].time_s": "game time, s",
    "events[].text": "what happened",
    "game.time_s": "game time at the end, s",
    "game.boats.*.tagged": "whether it is tagged",
    "game.boats.*.has_flag": "whether it carries the other team's flag",
    "game.boats.*.oob": "whether it is out of bounds, or lost",
    "game.boats.*.on_side": "whether it was on its own side at the look before the last",
    "game.boats.*.cooldown_s": "time since its last tag, up to the cool-down, s",
    "game.boats.*.driven": "whether the game drives it: tagged or out of bounds",
    "game.flags[].x_m": "where the flag is, m; blue's, then red's",
    "game.flags[].y_m": "where the flag is, m",
    "game.flags[].taken": "whether an opponent carries it",
    "game.captures[]": "flags captured by blue and red",
    "game.grabs[]": "flags grabbed by blue and red",
    "game.tags[]": "tags made by blue and red",
    "game.over": "whether the game ended",
    "game.note": "what the referee had to say last",
}
