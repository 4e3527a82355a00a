"""No slip in a FLEET.yaml ends in a traceback, hangs or eats the memory: it is taken, or refused in one line."""

import random
import resource
import time

import pytest
from steerclear.experiments.deploy.orders import rehearse
from steerclear.experiments.deploy.referee import game_obstacles
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.exceptions import SteerclearError

FAST = 300
MOST = 20_000
SLOWEST_S, MOST_KIB = 5.0, 300 << 10


ODD = (
    "010", "0x1F", "1_000", "5:30", "1:0", "yes", "no", "true", "null", "~", "", ".inf", "-.inf", ".nan", "1e400",
    "1e308", "-1", "0", "-0.0", "1e-320", "99999999999999999999999999999999", "²", "٣", "2024-01-01",
    "2024-01-01T10:00:00Z", "!!binary aGk=", "!!set {a}", "!!python/name:os.system", "&a [*a]", "*a", "<<", "{}",
    "[]", "[[[]]]", "{a: {b: c}}", "'x\\0'", '"\\0"', '"\\ud800"', '"\\x1b[2J"', "a" * 2000, "[" * 300, "- - - -",
    "? a", "|", ">", "%YAML 1.1", "'127.0.0.1:²'", "127.0.0.1:99999", "'udpin:[::1]:1'", "'serial:/dev/null:²'",
    "'tcp: :1'", "../../etc", "/dev/null", "/proc/self/mem", "agent_0", "agent_99999", "blue", "red", "heron",
    "surveyor", "di", "mctf2025", "1.0", "'1'", "\U0001f6a4", "é", "\t", "\r", "\ufeff", "\x00", "\x85", "\u2028",
)  # fmt: skip
MORE = (
    "shield: {{separation_m: {0}}}", "shield: {{{0}: 1}}", "shield: {{edge_m: {0}, position_error_m: {0}}}",
    "shield: {{dt_s: {0}}}", "shield: {{solver: {0}, certificate: {0}}}", "rules: {{{0}: {0}}}",
    "rules: {{name: {0}}}", "rules: {{preset_name: {0}}}", "rules: {{cls: {0}}}", "rules: {{max_time_s: {0}}}",
    "rules: {{obstacles: {0}}}", "rules: {{catch_radius_m: {0}}}", "rules: {{agent_radius_m: {0}}}",
    "rules: {{polygons: [[{0}, {0}]]}}", "platforms: {{{0}: {{max_speed_mps: {0}}}}}",
    "platforms: {{heron: {{kind: {0}, max_speed_mps: 1}}}}",
    "platforms: {{heron: {{max_speed_mps: 2, thrust_map: {0}}}}}", "platforms: {{heron: {{speed_pid: {0}}}}}",
    "platforms: {{heron: {{speed_pid: {{{0}: {0}}}}}}}", "platforms: {{heron: {{name: {0}, max_speed_mps: 1}}}}",
    "log_dir: {0}", "signing: {{key_file: {0}}}", "signing: {{key_file: {0}, link_id: {0}}}", "preset: {0}",
    "limits: {{{0}: {0}}}", "limits: {{contact: {{lost_after_s: {0}}}}}", "end: {{clear_s: {0}}}",
    "feed: {{listen: {0}}}", "geofence: {{xmin_m: 0, ymin_m: 0, xmax_m: {0}, ymax_m: {0}}}", "coordination: {0}",
    "rate_hz: {0}", "{0}: {0}",
)  # fmt: skip
"""Sections to replace or add."""


def mutant(seed):
    """A text with one to four values, keys or sections that are others, and at times letters lost."""
    dice, text = random.Random(seed), demo_text()
    for _ in range(dice.randint(1, 4)):
        what = dice.choice((":,[{", ":,[{", ":,[{", "\n", "section", "section", "letters"))
        at = dice.choice([i for i, letter in enumerate(text) if letter in what] or [0]) + 1
        if what == "section":
            added = dice.choice(MORE).format(dice.choice(ODD))
            old = added.partition(":")[0] + ":"
            kept = [line for line in text.split("\n") if not line.startswith(old) or dice.random() < 0.1]
            text = "\n".join([*kept, added])
        elif what == "letters":
            at = dice.randrange(len(text) + 1)
            text = text[:at] + text[at + dice.choice((1, 5, 100)) :]
        else:
            end = next((i for i in range(at + 1, len(text)) if text[i] in ":,]}\n"), len(text))
            text = f"{text[:at]} {dice.choice(ODD)}{text[end:]}"
    return text


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


@pytest.mark.parametrize("seeds", [range(FAST), pytest.param(range(10**6, 10**6 + MOST), marks=pytest.mark.study)])
def test_slips_are_taken_or_refused_in_one_line(seeds):
    assert read(demo_text()), "the file without a slip is taken"
    read(mutant(-1))
    before, taken, longest_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, 0, 0.0
    for seed in seeds:
        began = time.process_time()
        try:
            taken += read(mutant(seed))
        except Exception as error:
            pytest.fail(f"mutant {seed}: {type(error).__name__}: {error}")
        longest_s = max(longest_s, time.process_time() - began)
    assert 0 < taken < len(seeds) // 2, "mutants must differ from the file, and not all be nonsense"
    assert longest_s < SLOWEST_S
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_KIB
