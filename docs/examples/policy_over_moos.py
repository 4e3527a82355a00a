"""A policy of Pyquaticus' kind, unchanged, drives boats over MOOS: three simulated boats, each behind its own MOOSDB.

On boats of your own only FLEET.yaml differs: `steerclear deploy FLEET.yaml --policy our_team` does the rest.
"""

import contextlib
import re
import socket
import tempfile
from pathlib import Path

from steerclear.experiments.deploy.orders import Orders
from steerclear.experiments.deploy.run import deploy
from steerclear.experiments.sim_boats import SimFleet
from steerclear.experiments.sim_boats.demo import demo_text

SOLUTION = """
class solution:
    def compute_action(self, agent_id, obs_norm, obs, global_state):
        return [1.0, float(obs[agent_id]["opponent_home_bearing"])]  # m/s, and deg from the bow
"""


def on_free_ports(text):
    """The fleet file with MOOSDBs where nobody listens, and without a referee."""
    with contextlib.ExitStack() as stack:
        free = [stack.enter_context(socket.create_server(("127.0.0.1", 0))).getsockname()[1] for _ in range(3)]
    text = re.sub(r"moos://127.0.0.1:\d+", lambda _: f"moos://127.0.0.1:{free.pop()}", text)
    return re.sub(r"(?m)^feed: .*\n", "", text)


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    (folder / "our_team").mkdir()
    (folder / "our_team" / "solution.py").write_text(SOLUTION)
    (folder / "FLEET.yaml").write_text(on_free_ports(demo_text("moos")))
    orders = Orders(folder / "FLEET.yaml", str(folder / "our_team"), minutes=0.1, accept=("drill", "mission"))
    with SimFleet.from_file(orders.fleet_file) as boats:
        before = boats.states()
        outcome = deploy(orders)
        assert not outcome.refused, outcome.refused
        after = boats.states()
for boat in ("blue_1", "blue_2", "blue_3"):
    print(f"{boat} made {after[boat][0] - before[boat][0]:.1f} m towards the flag over MOOS")
print(*outcome.left, sep="\n")
