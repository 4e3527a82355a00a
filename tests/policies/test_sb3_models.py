"""Models of Stable-Baselines3: actions as they predict them; no code of strangers is run unasked."""

import base64
import importlib
import io
import json
import os
import zipfile

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from steerclear import policies
from steerclear.shield.exceptions import PolicyError

OWN = ["agent_0", "agent_1"]


class Shaped(gymnasium.Env):
    """An environment that only has spaces."""

    def __init__(self, observation_space, action_space):
        self.observation_space, self.action_space = observation_space, action_space

    def reset(self, *, seed=None, options=None):
        return self.observation_space.sample(), {}

    def step(self, action):
        return self.observation_space.sample(), 0.0, True, False, {}


@pytest.fixture
def save(game, tmp_path):
    """Saves an untrained model; answers its path."""
    library = pytest.importorskip("stable_baselines3")

    def save_model(algorithm, action_space, n_obs=None):
        observations = Box(-1.0, 1.0, (n_obs or game[0].core.n_obs,), np.float32)
        options = {"policy_kwargs": {"net_arch": [4]}, "seed": 0, "device": "cpu"}
        options |= {"n_steps": 8, "batch_size": 8} if algorithm == "PPO" else {}
        model = getattr(library, algorithm)("MlpPolicy", Shaped(observations, action_space), **options)
        model.save(tmp_path / algorithm)
        return tmp_path / f"{algorithm}.zip", model

    return save_model


def play(path, game):
    env, observations, infos = game
    team = policies.make(f"sb3:{path}")
    team.reset(env, OWN, 0)
    actions = team.act(observations, infos)
    assert not team.report().failures
    return actions


@pytest.mark.parametrize("algorithm", ["PPO", "DQN", "A2C"])
def test_a_discrete_model_sends_numbers_and_a_box_model_speed_and_heading(game, save, algorithm):
    box = Box(np.float32([0.0, -180.0]), np.float32([2.0, 180.0]))
    path, model = save(algorithm, box if algorithm == "A2C" else Discrete(17))
    for agent_id, action in play(path, game).items():
        assert type(action) is int or algorithm == "A2C"
        np.testing.assert_array_equal(action, model.predict(game[1][agent_id], deterministic=True)[0])


def test_a_unit_box_model_is_scaled(game, save):
    path, model = save("SAC", Box(-1.0, 1.0, (2,), np.float32))
    for agent_id, action in play(path, game).items():
        answer = model.predict(game[1][agent_id], deterministic=True)[0].astype(float)
        assert action == pytest.approx((answer[0] + 1.0, 180.0 * answer[1]))


def test_a_model_of_another_game_is_refused(game, save):
    path, _ = save("PPO", Discrete(17), n_obs=7)
    with pytest.raises(PolicyError, match=r"takes observations \(7,\)"):
        play(path, game)


def test_a_missing_extra_is_named(tmp_path, monkeypatch):
    path = tmp_path / "model.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps({"clip_range": 1}))

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(PolicyError, match=r"steerclear\[train\]"):
        policies.make(f"sb3:{path}")


def test_files_that_are_no_model_are_refused(tmp_path):
    with pytest.raises(PolicyError, match="no model at"):
        policies.make("sb3:nothing.zip")
    wrong = tmp_path / "wrong.zip"
    wrong.write_bytes(b"x")
    with pytest.raises(PolicyError, match="not a Stable-Baselines3 model"):
        policies.make(f"sb3:{wrong}")
    with pytest.raises(PolicyError, match="unknown algorithm 'PPP'"):
        policies.make(f"sb3:{wrong}", algorithm="PPP")


class Bomb:
    """Pickles to a call that leaves a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.makedirs, (str(self.path), 0o777, True)


@pytest.fixture
def bomb(tmp_path):
    """Writes a model whose loading leaves a folder; answers the model's path and the folder's."""

    def write(folder):
        cloudpickle = pytest.importorskip("cloudpickle")
        (tmp_path / folder).mkdir(parents=True)
        path, left = tmp_path / folder / "model.zip", tmp_path / "left"
        packed = base64.b64encode(cloudpickle.dumps(Bomb(left))).decode()
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("data", json.dumps({"clip_range": {":type:": "x", ":serialized:": packed}}))
        return path, left

    return write


def test_that_a_model_runs_code_is_said_once_before_it_does(bomb, caplog, monkeypatch):
    pytest.importorskip("stable_baselines3")
    path, left = bomb("mine")
    seen = []
    monkeypatch.setattr(caplog.handler, "emit", lambda record: seen.append((record.getMessage(), left.exists())))
    for _ in range(2):
        with pytest.raises(PolicyError, match="cannot be loaded as PPO"):
            policies.make(f"sb3:{path}")
    assert left.exists(), "it does"
    said = [entry for entry in seen if "runs code of whoever made it" in entry[0]]
    assert said == [(f"loading the model {path} runs code of whoever made it", False)]


@pytest.mark.parametrize("folder", ["Entries/ours", "x/submissions", "cup/tournament/a/b"])
def test_a_model_among_entries_is_refused_unless_allowed(bomb, folder):
    path, left = bomb(folder)
    with pytest.raises(PolicyError, match=r"runs code .* among entries of others .*allow_code=True"):
        policies.make(f"sb3:{path}")
    assert not left.exists()
    pytest.importorskip("stable_baselines3")
    with pytest.raises(PolicyError, match="cannot be loaded as PPO"):
        policies.make(f"sb3:{path}", allow_code=True)
    assert left.exists()


def test_a_model_in_a_submission_or_behind_a_link_into_one_is_refused_and_any_may_be(bomb, tmp_path):
    path, left = bomb("ours/weights")
    (tmp_path / "ours" / "solution.py").touch()
    (tmp_path / "link.zip").symlink_to(path)
    for place in (path, tmp_path / "link.zip"):
        with pytest.raises(PolicyError, match="among entries"):
            policies.make(f"sb3:{place}")
    (tmp_path / "ours" / "solution.py").unlink()
    with pytest.raises(PolicyError, match="allow_code is False"):
        policies.make(f"sb3:{path}", allow_code=False)
    assert not left.exists()


def zeros(path, name, size, inner=""):
    """A zip of so many zeros; ``inner``: packed once more under that name."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data" if inner else name, b"0" * size)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        if inner:
            archive.writestr("data", "{}")
            archive.writestr(inner, content.getvalue())
        else:
            archive.writestr(name, b"0" * size)


@pytest.mark.parametrize(
    ("name", "inner", "words"),
    [
        ("policy.pth", "", "unpacks to"),
        ("data", "", "unpacks to"),
        ("data", "policy.pth", "weights unpack to"),
    ],
)
def test_a_model_that_unpacks_to_too_much_is_refused(tmp_path, name, inner, words):
    zeros(tmp_path / "model.zip", name, 3_000_000, inner)
    with pytest.raises(PolicyError, match=words):
        policies.make(f"sb3:{tmp_path / 'model.zip'}", max_bytes=1_000_000)


@pytest.mark.parametrize("data", ["[" * 100_000, "[]", "3", "\xff", '{"a": ' * 5000])
def test_settings_of_a_wrong_form_are_one_clear_error(tmp_path, data):
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr("data", data)
    with pytest.raises(PolicyError, match="is not a Stable-Baselines3 model"):
        policies.make(f"sb3:{tmp_path / 'model.zip'}")
