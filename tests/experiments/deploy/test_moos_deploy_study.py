"""A competition submission, unchanged, steers boats that run MOOS; its log is decided again, bit for bit."""

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.study

SOLUTION = """
class solution:
    def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
        bearing = float(full_obs[agent_id]["opponent_home_bearing"])
        turns = [180, 135, 90, 45, 0, -45, -90, -135]
        return min(range(8), key=lambda k: abs((bearing - turns[k] + 180) % 360 - 180))
"""


def steerclear(folder, *arguments):
    command = [sys.executable, "-m", "steerclear.experiments.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


def test_a_submission_steers_boats_that_run_moos_and_its_log_is_decided_again(tmp_path):
    (tmp_path / "our_team").mkdir()
    (tmp_path / "our_team" / "solution.py").write_text(SOLUTION, encoding="utf-8")
    options = ("--policy", "our_team", "--minutes", "0.4", "--plain", "--json", "run.json")
    run = steerclear(tmp_path, "deploy", "--demo", "--link", "moos", *options)
    assert run.returncode == 0, run.stderr[-2000:]
    content = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert "moosdb:blue_1" in run.stdout + run.stderr
    (log,) = tmp_path.glob("steerclear_demo/*/logs/*.mcap")
    replay = steerclear(tmp_path, "replay", log)
    assert replay.returncode == 0, replay.stdout[-2000:]
    assert "the same bit for bit" in " ".join(replay.stdout.split())
    assert content["figures"]["ticks"] > 100
