"""Games and submissions that the policy tests share."""

import textwrap

import pytest
from steerclear import policies
from steerclear.env.mctf import MctfEnv


@pytest.fixture
def game():
    """A 3 v 3 game that has just begun: env, observations, infos."""
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1)
    yield env, observations, infos
    env.close()


@pytest.fixture
def write_entry(tmp_path):
    """Writes a submission folder from its solution.py and other files; answers its path."""

    def write(solution, name="entry", **files):
        folder = tmp_path / name
        folder.mkdir()
        for path, text in {"solution.py": solution, **files}.items():
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(textwrap.dedent(text))
        return folder

    return write


@pytest.fixture
def load(write_entry):
    """Loads submissions and closes them when the test is over."""
    loaded = []

    def load_entry(source, **options):
        team = policies.load_submission(source, **options)
        loaded.append(team)
        return team

    yield load_entry
    for team in loaded:
        team.close()
