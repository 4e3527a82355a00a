"""Boats fitted by the page's own commands among rammers: what their model misses is made up for."""

import logging
import sys
from pathlib import Path

import pytest
from boat_page import follow
from rammed_fleet import sail
from steerclear.experiments.sim_boats.demo import off_platform
from steerclear.shield.platforms import get_platform

MINUTES, SEEDS = 15.0, (1, 2, 3, 4)


@pytest.mark.study
def test_a_fitted_fleet_among_rammers_keeps_its_distance(tmp_path, capsys):
    """An hour with the shield and one whose decisions nobody heeds, of boats 20 % off what they are said to be."""
    logging.disable(logging.WARNING)
    follow(tmp_path, "fit")
    true = off_platform(get_platform("ardurover_boat"), 0.2, "blue_1", 0)
    hits = {}
    for shielded in (True, False):
        hits[shielded] = [
            sail(tmp_path, Path(tmp_path / "my_boat.yaml"), true, MINUTES, seed, shielded) for seed in SEEDS
        ]
    logging.disable(logging.NOTSET)
    with capsys.disabled():
        for shielded, found in hits.items():
            closest = [[round(m, 2) for m in f.closest_m] for f in found]
            counts = f"mates {[f.mates for f in found]}, opponents {[f.opponents for f in found]}, closest, m {closest}"
            sys.stderr.write(f"\nshield {'on' if shielded else 'off'}: {counts}\n")
    assert sum(f.mates for f in hits[True]) == 0
    assert sum(f.opponents for f in hits[False]) > 100, "rammers ram"
    assert sum(f.opponents for f in hits[True]) <= 0.1 * sum(f.opponents for f in hits[False])
