"""Keys of the JSON that `steerclear deploy` and `steerclear preflight` write, with meaning and unit."""

from __future__ import annotations

DEPLOY = {
    "ended": "why the run ended; empty: it never began",
    "refused[]": "checks neither passed nor accepted",
    "checks[].name": "name of the check, with the boat's where it is about one",
    "checks[].passed": "whether it passed",
    "checks[].text": "what was found, and the remedy",
    "checks[].figures.*": "what was measured; the unit ends the name",
    "left[]": "what each boat was left doing, and boats on the way to one of them then",
    "log": "path of the black box, or of the kept preflight; null: none",
    "figures.ticks": "turns of the loop",
    "figures.decided": "of those, with a decision",
    "figures.changed_share": "share of own boats' commands that the shield changed, 0 to 1",
    "figures.best_effort_commands": "own boats' commands for which no manoeuvre kept the margin",
    "figures.ticks_with_actions": "turns in which a declared response, an override or STOP ALL did something",
    "figures.closest_m": "closest approach of an own boat to any other, as believed, m",
    "figures.least_certificate_m": "smallest certificate of an own boat, m",
    "figures.missed_turns": "turns left out because the loop was late",
    "figures.jitter_p50_s": "turns begun after they were due, median, s",
    "figures.jitter_p999_s": "the same, 999 of 1000, s",
    "figures.jitter_max_s": "the same, the worst, s",
    "figures.read_to_sent_p50_s": "from reading telemetry to the last command sent, median, s",
    "figures.read_to_sent_p99_s": "the same, 99 of 100, s",
    "figures.read_to_sent_max_s": "the same, the worst, s",
    "figures.decide_p99_s": "the shield's decision alone, 99 of 100, s",
}
