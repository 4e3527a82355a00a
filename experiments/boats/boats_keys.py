"""Keys of the JSON that `steerclear sim-boats` writes, with meaning and unit."""

from __future__ import annotations

SIM_BOATS = {
    "simulated_s": "simulated time, s",
    "let_go_s": "time not lived because the machine was too slow, s",
    "cpu_s": "processor time of the simulation, s",
    "played": "whether the game began: every boat with a link was commanded",
    "boats.*.address": "its link's address; null: no link",
    "boats.*.driven_by": "policy that drives it; empty: its link or nobody",
    "boats.*.taken": "packets it obeyed or answered",
    "boats.*.refused": "packets damaged, unsigned or wrongly signed",
    "boats.*.ignored": "packets it passes over silently, such as commands outside GUIDED",
    "boats.*.lost_down": "packets the radio lost on the way to the commander",
    "boats.*.lost_up": "packets the radio lost on the way to the boat",
    "closest[].first": "one boat",
    "closest[].second": "the other",
    "closest[].distance_m": "closest approach of their centres, m",
    "closest[].time_s": "when, simulated s",
    "captures[]": "flags captured by blue and red, when recorded",
    "tags[]": "tags made by blue and red, when recorded",
    "breaches[].unsteered_s[]": "for how long nobody had steered each of the two boats, s; 0: somebody did",
    "breaches[].faults[]": "faults of simulated boats that acted on one of the two then or in the 5 s before",
    "breaches[].after_run": "whether the boats of the breach had been left in HOLD and nobody steered any from then on",
    "clean": "whether the run had neither a breach of team-mates nor an avoidable one; false when not recorded",
    "files[]": "what was written",
}
"""Beside these: ``breaches`` of the team the file names, as other commands give them, when recorded."""
