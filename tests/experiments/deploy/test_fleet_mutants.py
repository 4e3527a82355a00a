"""No slip in a FLEET.yaml ends in a traceback, hangs or eats the memory: it is taken, or refused in one line."""

import resource
import time

import pytest
from fleet_mutants import mutant
from steerclear.experiments.deploy.orders import rehearse
from steerclear.experiments.deploy.rules import game_obstacles
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.exceptions import SteerclearError

FAST = 300
MOST = 20_000
SLOWEST_S, MOST_KIB = 5.0, 300 << 10


def read(text):
    """What all programs do with the text of a file before they open anything; whether it is taken."""
    said = ""
    try:
        fleet = parse_fleet(text)
        rehearse(fleet, game_obstacles(fleet))
    except SteerclearError as error:
        said = str(error)
    assert said.isprintable(), repr(said)
    assert len(said) < 3000
    return not said


def read_all(seeds):
    """How many are taken, and the longest time of one, s."""
    taken, longest_s = 0, 0.0
    for seed in seeds:
        began = time.process_time()
        try:
            taken += read(mutant(seed))
        except Exception as error:
            pytest.fail(f"mutant {seed}: {type(error).__name__}: {error}")
        longest_s = max(longest_s, time.process_time() - began)
    return taken, longest_s


def used_kib():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def test_the_file_without_a_slip_is_taken():
    from steerclear.experiments.sim_boats.demo import demo_text

    assert read(demo_text())


def test_slips_are_taken_or_refused_in_one_line():
    read(mutant(-1))
    before = used_kib()
    taken, longest_s = read_all(range(FAST))
    assert 0 < taken < FAST // 2, "mutants must differ from the file, and not all be nonsense"
    assert longest_s < SLOWEST_S
    assert used_kib() - before < MOST_KIB


@pytest.mark.study
def test_many_slips_are_taken_or_refused_in_one_line():
    read(mutant(-1))
    before = used_kib()
    taken, longest_s = read_all(range(1_000_000, 1_000_000 + MOST))
    assert 0 < taken < MOST // 2
    assert longest_s < SLOWEST_S
    assert used_kib() - before < MOST_KIB
