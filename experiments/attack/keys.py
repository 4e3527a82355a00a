"""Keys of the JSON that ``steerclear attack`` writes, with meaning and unit."""

from __future__ import annotations

ATTACK = {
    "complete": "false when interrupted or a search could not be run",
    "searches[].restart": "number of the search",
    "searches[].closest_m": "least distance that any of its opponents came to an own boat, m",
    "searches[].history[]": "the least distance after each generation, m",
    "searches[].tried": "opponents played",
    "searches[].breached": "of those, how many got within the radius",
    "searches[].judged[].*": "breaches the oracle judged: distance, entries, certificate at the start, verdicts",
    "searches[].scene": "file with the avoidable breach found; null without one",
    "failed[].*": "search that could not be run, and why",
    "found": "searches that found an avoidable breach",
    "files.*": "what was written, relative to the folder",
}
