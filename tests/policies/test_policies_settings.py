"""What a submission sets for the whole process is its own: others find theirs, and it finds its own again."""

import os
import random
import sys
import warnings

import numpy as np
import pytest

OWN = ["agent_0"]

UPSET = """
    import os, random, sys, warnings
    import numpy as np

    class solution:
        def __init__(self):
            np.seterr(all="raise"); np.random.seed(7); random.seed(7)
            os.environ["UPSET"] = "1"; os.environ.pop("KEPT", None); os.chdir("/")
            sys.path.append("/upset"); warnings.simplefilter("ignore")

        def compute_action(self, agent_id, *rest):
            kept = np.geterr()["over"], os.environ.get("UPSET"), "KEPT" in os.environ, "/upset" in sys.path
            assert kept == ("raise", "1", False, True), kept
            return random.randrange(8)
"""


def state():
    """Everything that is to be as it was."""
    return {
        "errors": np.geterr(),
        "chance": (random.getstate(), np.random.get_state()[1].tolist()),  # noqa: NPY002
        "environment": dict(os.environ),
        "folder": os.getcwd(),
        "path": list(sys.path),
        "warnings": list(warnings.filters),
    }


def test_settings_of_the_process_stay_with_the_submission(game, write_entry, load, monkeypatch):
    env, observations, infos = game
    monkeypatch.setenv("KEPT", "1")
    before = state()
    team = load(write_entry(UPSET))
    assert state() == before
    team.reset(env, OWN, 5)
    actions = [team.act(observations, infos)["agent_0"] for _ in range(10)]
    assert team.report().failures == ()
    assert state() == before
    random.seed(7)
    assert actions == [random.randrange(8) for _ in range(10)], "its own draws go on where they were"


def test_settings_of_torch_stay_with_the_submission(game, write_entry, load):
    torch = pytest.importorskip("torch")
    env, observations, infos = game
    before = torch.get_default_dtype(), torch.is_grad_enabled(), torch.get_rng_state().tolist()
    head = "import torch\ntorch.set_default_dtype(torch.float64); torch.set_grad_enabled(False); torch.rand(3)\n"
    body = "class solution:\n    def compute_action(self, *rest):\n        "
    team = load(write_entry(head + body + "return 4 if torch.rand(1).dtype == torch.float64 else 16\n"))
    team.reset(env, OWN, 5)
    assert team.act(observations, infos) == {"agent_0": 4}
    assert (torch.get_default_dtype(), torch.is_grad_enabled(), torch.get_rng_state().tolist()) == before


def test_two_submissions_do_not_draw_from_one_anothers_chance(game, write_entry, load):
    env, observations, infos = game
    dice = "import random\nclass solution:\n    def compute_action(self, *rest):\n        return random.randrange(8)\n"
    alone, beside, other = (load(write_entry(dice, name=f"dice{k}")) for k in range(3))
    alone.reset(env, OWN, 3)
    drawn = [alone.act(observations, infos) for _ in range(6)]
    beside.reset(env, OWN, 3)
    other.reset(env, ["agent_3"], 4)
    again = []
    for _ in range(6):
        again.append(beside.act(observations, infos))
        other.act(observations, infos)
    assert again == drawn
