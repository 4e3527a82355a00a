"""Keys of the JSON that ``steerclear encounters`` writes, with meaning and unit."""

from __future__ import annotations

CELL_KEYS = {
    "guard": "what stood between policy and boats",
    "own": "platform of the own boats",
    "other": "platform of the others",
    "family": "kind of encounter",
    "encounters": "encounters played",
    "breached": "encounters in which an own boat came within the radius of any boat",
    "breached_upper": "95 % upper limit of the probability of that (Clopper-Pearson, one-sided)",
    "unshielded_breached": "the same scenes without a guard: how many were breached",
    "avoidable": "encounters with a breach that an own boat could have avoided, by the oracle",
    "avoidable_upper": "95 % upper limit of the probability of that; what was not judged counts as avoidable",
    "unavoidable": "encounters with breaches of which none was avoidable",
    "started_inside": "encounters whose breaches were under way at the start",
    "not_judged": "encounters with breaches that the oracle was not asked about, and no avoidable one",
    "responsible.*": "encounters by whose command let the last chance pass: own, opponent, both, neither, start",
    "started_outside": "encounters in which the shield's certificate at the first decision was at least 0",
    "breaches_outside": "of those, how many were breached",
    "breaches_outside_upper": "95 % upper limit of the probability of that",
    "breaches_teammate": "entries of two own boats into the radius, all encounters",
    "breaches_opponent": "entries of an own boat and another, all encounters",
    "closest_m": "least distance of all encounters, m",
    "closest_quantiles_m[]": "quantiles 0, 0.01, ..., 1 of the closest distance of an encounter, m",
    "unshielded_closest_quantiles_m[]": "the same without a guard, m",
    "changed_percent": "share of the own boats' steps whose command was changed, %",
    "heading_change_deg": "mean change of the commanded heading over changed steps, deg",
    "speed_change_mps": "mean change of the commanded speed over changed steps, m/s",
    "goal_time_ratio": "time to the first goal over that without a guard; never there counts as the whole length",
    "reached_percent": "own boats that reached their first goal, %",
    "deadlocked": "encounters in which two team-mates that want to move stood still for over 10 s",
    "reversals_per_min": "flips of the commanded side per own boat and minute",
    "unshielded_reversals_per_min": "the same without a guard",
    "outside_m": "how far an own boat left the field at most, m",
    "decision_us": "median time of a decision per game and step, in batches, us",
    "decision_p999_us": "99.9th percentile of the same, worst chunk, us",
}

WORST_KEYS = {
    "guard": "guard",
    "own": "platform of the own boats",
    "other": "platform of the others",
    "family": "family",
    "number": "number of the encounter: with family, platforms and seed it gives the scene",
    "variant": "which of its variants (sudden turns) was the worst",
    "closest_m": "closest distance, m",
    "breaches": "entries into the radius",
    "avoidable": "of those judged, how many were avoidable",
    "last_preventable_s": "how long before the breach an own boat could still avoid it, s; null when never",
    "responsible": "whose command let the last chance pass; null when not judged",
    "start_certificate_m": "the shield's certificate at the first decision, m; null when nobody was near",
}

ENCOUNTERS = {
    "complete": "false when interrupted or something could not be played",
    "encounters_played": "encounters in the results, over all cells",
    "encounters_resumed": "of those, how many an earlier run had played",
    "failed[].*": "cell, first encounter and error of a chunk that could not be played",
    **{f"cells[].{name}": words for name, words in CELL_KEYS.items()},
    **{f"worst[].{name}": words for name, words in WORST_KEYS.items()},
    "files.*": "what was written, relative to the folder",
}
