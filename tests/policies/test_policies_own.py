"""A policy of your own by the name of its file or module."""

from pathlib import Path

import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv
from steerclear.experiments import cli
from steerclear.experiments.console import ExitCode
from steerclear.experiments.entries.team import is_entry
from steerclear.policies.own import own_code
from steerclear.shield.exceptions import PolicyError
from typer.testing import CliRunner

OWN = ["agent_0", "agent_1", "agent_2"]
CODE = """
import beside

def act(observation):
    return beside.COMMAND

class Team:
    name = "mine"
    def reset(self, env, agent_ids, seed):
        self.ids = agent_ids
    def act(self, observations, infos):
        return dict.fromkeys(self.ids, (1.0, 10.0))

class Agent:
    def __init__(self, agent_id, env): pass
    def compute_action(self, obs, info):
        return (1.0, 20.0)

NUMBER = 3
class Broken:
    def __init__(self): raise RuntimeError("no luck")
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", ["", *__import__("sys").path])
    Path("mypol.py").write_text(CODE)
    Path("beside.py").write_text("COMMAND = (1.0, 5.0)\n")


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("mypol.py", (1.0, 5.0)),
        ("./mypol.py", (1.0, 5.0)),
        ("mypol:act", (1.0, 5.0)),
        ("mypol.py:Team", (1.0, 10.0)),
        ("mypol:Agent", (1.0, 20.0)),
    ],
)
def test_what_is_in_a_file_plays(name, action):
    policies.check(name)
    assert not is_entry(name)
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1)
    team = policies.make(name)
    team.reset(env, OWN, 1)
    assert team.act(observations, infos) == dict.fromkeys(OWN, action)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gone.py", "there is no policy gone.py:act"),
        ("gone:act", "there is no policy gone:act"),
        ("mypol:swim", "mypol has no 'swim'; define there a function act"),
        ("mypol:NUMBER", "is a int; give a function act"),
        ("mypol:Broken", "cannot be built: RuntimeError: no luck"),
    ],
)
def test_what_is_no_policy_is_refused_in_words(name, words):
    def both():
        policies.check(name)
        policies.make(name)

    with pytest.raises(PolicyError, match=words):
        both()


@pytest.mark.parametrize("name", ["medium", "sb3:model", "weights:net", "team/solution.py", "team.zip", "a b:c"])
def test_other_names_stay_what_they_are(name):
    assert own_code(name) is None


@pytest.mark.parametrize("name", ["mypol.py", "mypol:act"])
def test_commands_take_it(name):
    done = CliRunner().invoke(cli.app, ["play", "--own", name, "--opponent", "hold", "--max-time", "2", "--no-shield"])
    assert done.exit_code == ExitCode.OK, done.output


def test_its_digest_is_of_its_own_file():
    before = policies.fingerprint("mypol:act")
    assert before == policies.fingerprint("mypol.py") != ""
    Path("other.py").write_text("")
    assert policies.fingerprint("mypol.py") == before
    Path("mypol.py").write_text(CODE + "#")
    assert policies.fingerprint("mypol.py") != before
