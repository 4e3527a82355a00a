"""Everything that the loop runs is compiled before boats are armed: none waits for the compiler while it steers."""

import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[2]
PROGRAM = """
from bridge_fakes import pair
from test_fault_figures import DRILLS, STRUCK_S
from steerclear.experiments.deploy.quiet import warm_up
from steerclear.shield import jit

world = pair()
world.run(0.0)
warm_up(world.fleet)
made, load = [], jit._Kept.load_overload
jit._Kept.load_overload = lambda kept, *args: made.append(kept._name) or load(kept, *args)
world.run(6.0)
for name in ("telemetry frozen, fresh time stamps", "telemetry jumps 30 m, the feed does not", "disk full"):
    again = pair()
    again.run(12.0, lambda world: world.clock.now_s() >= STRUCK_S - 1e-6 and DRILLS[name][0](world))
print("late:", made)
"""


def test_no_machine_code_is_made_while_boats_are_steered():
    path = [str(TESTS), str(TESTS / "shield"), str(TESTS / "shield" / "bridge")]
    program = f"import sys; sys.path[:0] = {path!r}\n{PROGRAM}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "late: []"
