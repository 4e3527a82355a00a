"""What a submission sets for the whole process is its own: others find theirs, and it finds its own again."""

import builtins
import decimal
import gc
import json
import locale
import logging
import os
import random
import signal
import sys
import threading
import time
import warnings

import numpy as np
import pytest

OWN = ["agent_0"]

UPSET = """
    import builtins, decimal, gc, json, locale, logging, os, random, signal, sys, threading, time, warnings
    import numpy as np

    class Mine:
        def write(self, text): pass
        def flush(self): pass

    def now():
        return -1.0

    class solution:
        def __init__(self):
            np.seterr(all="raise"); np.set_printoptions(precision=1); np.random.seed(7); random.seed(7)
            os.environ["UPSET"] = "1"; os.environ.pop("KEPT", None); os.chdir("/")
            sys.path.append("/upset"); sys.setrecursionlimit(4321); sys.stdout = Mine(); gc.disable()
            logging.disable(50); logging.root.setLevel(1); logging.root.addHandler(logging.NullHandler())
            logging.getLogger("steerclear").setLevel(50)
            warnings.simplefilter("ignore"); decimal.getcontext().prec = 3; locale.setlocale(locale.LC_ALL, "C")
            signal.signal(signal.SIGTERM, signal.SIG_IGN); signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(30)
            builtins.sorted = list; time.time = now; json.dumps = str; np.clip = None
            sys.excepthook = threading.excepthook = None

        def compute_action(self, agent_id, *rest):
            kept = (
                np.geterr()["over"], os.environ.get("UPSET"), "KEPT" in os.environ, "/upset" in sys.path, time.time(),
                sys.getrecursionlimit(), decimal.getcontext().prec, builtins.sorted is list, gc.isenabled(),
            )
            assert kept == ("raise", "1", False, True, -1.0, 4321, 3, True, False), kept
            return random.randrange(8)
"""


def state():
    """Everything that is to be as it was."""
    return {
        "errors": np.geterr(),
        "print": np.get_printoptions(),
        "chance": (random.getstate(), np.random.get_state()[1].tolist()),  # noqa: NPY002
        "environment": dict(os.environ),
        "folder": os.getcwd(),
        "path": list(sys.path),
        "limit": sys.getrecursionlimit(),
        "streams": (sys.stdout, sys.stderr, sys.excepthook, threading.excepthook),
        "collecting": gc.isenabled(),
        "log": (logging.root.manager.disable, logging.root.level, list(logging.root.handlers)),
        "our log": logging.getLogger("steerclear").level,
        "warnings": list(warnings.filters),
        "decimal": decimal.getcontext().prec,
        "locale": locale.setlocale(locale.LC_ALL),
        "signals": [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGALRM, signal.SIGINT)],
        "alarm": signal.getitimer(signal.ITIMER_REAL),
        "names": (builtins.sorted, time.time, json.dumps, np.clip),
    }


def test_settings_of_the_process_stay_with_the_submission(game, write_entry, load, monkeypatch):
    env, observations, infos = game
    monkeypatch.setenv("KEPT", "1")
    before = state()
    team = load(write_entry(UPSET))
    assert state() == before
    team.reset(env, OWN, 5)
    actions = [team.act(observations, infos)["agent_0"]]
    assert state() == before
    sys.setrecursionlimit(before["limit"] + 7)  # what others change meanwhile is theirs
    actions += [team.act(observations, infos)["agent_0"] for _ in range(9)]
    assert sys.getrecursionlimit() == before["limit"] + 7
    sys.setrecursionlimit(before["limit"])
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
