"""PPO: gone on with to the same curve, exported as it plays, begun with weights, stopped in words."""

import json
import zipfile

import numpy as np
import pytest
from commands import run
from steerclear.experiments.training.config import read_config
from steerclear.experiments.training.ppo import FACTS, PpoTraining, newest, read_checkpoint
from steerclear.experiments.training.training import DivergedError
from steerclear.policies.entrants.learned import read_weights
from steerclear.policies.entrants.learned.network import Features, Network, joined, write_weights
from steerclear.shield.exceptions import ConfigError

NONE = Features(np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0)
SHIELDED = {
    "net": {"hidden": [16], "roles": "placed"},
    "ppo": {"steps": 6, "batch": 18, "epochs": 2, "critic_first": 3},
    "shield": "training",
    "shield_every": 5,
    "stages": [
        {"opponents": ["hold"], "games": 2, "net": -5, "shielded": False, "rewards": {"tagging": 0.5}},
        {"opponents": ["medium"], "games": 2, "net": -5, "rules": {"catch_radius_m": 5.0, "max_time_s": 9.0}},
        {"opponents": ["medium"], "cooldown_s": [10, 40], "shield_settings": {"separation_m": 1.0}},
    ],
}


def without_time(curve):
    return [{name: value for name, value in row.items() if name != "wall"} for row in curve]


def stop_at(decisions):
    def stop(done, words):
        if done >= decisions:
            raise KeyboardInterrupt

    return stop


def trained(config, folder, resume=False):
    training = PpoTraining(read_config(config), folder, resume)
    training.run()
    return training


def numbers(network):
    return [*network.weights, *network.biases]


def changes_of(one, two):
    return max(float(np.abs(a - b).max()) for a, b in zip(numbers(one), numbers(two), strict=True))


def test_a_resumed_training_is_the_same_bit_for_bit(tiny, tmp_path):
    """Whatever threads share the shield's games."""
    changes = SHIELDED
    reference = PpoTraining(read_config(tiny(**changes)), tmp_path / "whole")
    at_first = reference.network()
    reference.run()
    assert changes_of(at_first, reference.network()) > 0.0
    for stop in (36, 108):
        with pytest.raises(KeyboardInterrupt):
            PpoTraining(read_config(tiny(**changes)), tmp_path / "half", resume=True).run(stop_at(stop))
        rows = json.loads((tmp_path / "half" / "curve.json").read_text())["rows"]
        assert rows[-1]["decisions"] == stop
        kept = PpoTraining(read_config(tiny(**changes)), tmp_path / "half", resume=True).network()
        assert changes_of(at_first, kept) == 0.0, "the critic learns alone at first"
        changes = {**changes, "shield_threads": 2}
    again = trained(tiny(**changes), tmp_path / "half", resume=True)
    assert without_time(again.curve) == without_time(reference.curve)
    assert changes_of(again.network(), reference.network()) == 0.0


def test_an_evaluation_that_fails_loses_nothing_and_is_made_up_for(tiny, tmp_path, monkeypatch):
    def failing(*arguments):
        raise RuntimeError("an opponent's file is gone")

    config, folder = tiny(evaluation={"every": 100, "games": 2}, decisions=72), tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr("steerclear.experiments.training.training.play_games", failing)
        with pytest.raises(RuntimeError, match="is gone"):
            trained(config, folder)
    facts, _ = read_checkpoint(newest(folder))
    assert facts["decisions"] == 72
    assert "evaluation" not in facts["curve"][-1]
    kept = read_weights(folder / "final.npz")
    gone_on = trained(config, folder, resume=True)
    assert gone_on.curve[-1]["evaluation"]["medium"]["games"] == 2
    assert changes_of(kept, gone_on.network()) == 0.0


def test_a_loss_that_is_not_finite_ends_in_one_line_and_keeps_what_was(tiny, tmp_path):
    training = PpoTraining(read_config(tiny()), tmp_path / "run")

    def poison(done, words):
        for parameter in training.model.policy.parameters():
            parameter.data.fill_(float("nan"))

    with pytest.raises(DivergedError, match=r"no longer finite; lower ppo\.learning_rate"):
        training.run(poison)
    path = newest(tmp_path / "run")
    assert read_checkpoint(path)[0]["rollouts"] == 1
    export = run("export", path, "--out", tmp_path / "team.npz")
    assert export.exit_code == 0, export.output
    assert "for games of preset aamas2024" in export.output
    assert all(np.isfinite(values).all() for values in numbers(read_weights(tmp_path / "team.npz")))


def test_a_damaged_or_foreign_checkpoint_is_refused_in_one_line_and_kept(tiny, tmp_path):
    folder = tmp_path / "run"
    trained(tiny(decisions=36), folder)
    with pytest.raises(ConfigError, match="another net; resume with its own config"):
        PpoTraining(read_config(tiny(net={"hidden": [8]}, decisions=36)), folder, resume=True)
    path = newest(folder)
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    for change, words in (
        (lambda facts: facts.pop("pool"), "'pool' is missing"),
        (lambda facts: facts.pop("settings"), "'settings' is missing"),
        (lambda facts: facts.update(stage=99), "out of range"),
    ):
        facts = json.loads(content[FACTS])
        change(facts)
        with zipfile.ZipFile(path, "w") as archive:
            for name, value in {**content, FACTS: json.dumps(facts)}.items():
                archive.writestr(name, value)
        with pytest.raises(ConfigError, match=rf"damaged or of another version.*{words}.*delete it"):
            PpoTraining(read_config(tiny(decisions=36)), folder, resume=True)
    path.write_bytes(whole[:500])
    with pytest.raises(ConfigError, match=r"no whole checkpoint.*delete it"):
        PpoTraining(read_config(tiny(decisions=36)), folder, resume=True)
    path.rename(path.with_suffix(".npz"))
    with pytest.raises(ConfigError, match=r"a training of 0\.8\.0 or before, which only that version goes on with"):
        PpoTraining(read_config(tiny(decisions=36)), folder, resume=True)


@pytest.mark.parametrize("roles", ["shared", "placed", "each"])
def test_exported_networks_play_as_the_trained_ones(tiny, tmp_path, roles):
    import torch

    training = trained(tiny(net={"hidden": [16, 8], "roles": roles}, decisions=36), tmp_path / "run")
    path = str(tmp_path / "run" / "final.npz")
    network = read_weights(path)
    seen = np.random.default_rng(0).uniform(-1, 1, (300, network.n_obs)).astype(np.float32)
    places = np.arange(300) % 3
    told = seen if roles == "shared" else np.concatenate([seen, np.eye(3, dtype=np.float32)[places]], axis=1)
    with torch.no_grad():
        logits = training.model.policy.get_distribution(torch.as_tensor(told)).distribution.logits.numpy()
    ours = network.outputs(seen, places)
    assert np.abs((ours - ours.max(1, keepdims=True)) - (logits - logits.max(1, keepdims=True))).max() < 1e-5
    if roles == "each":
        refused = "start takes one"
    else:
        begun = PpoTraining(
            read_config(tiny(net=training.config.net.model_dump(mode="json"), start=path)), tmp_path / "b"
        )
        assert changes_of(begun.network(), network) < 1e-6
        refused = "layers of shapes"
    with pytest.raises(ConfigError, match=f"does not fit this network: .*{refused}"):
        PpoTraining(read_config(tiny(net={"hidden": [8], "roles": roles}, start=path)), tmp_path / "c")


def test_a_pair_of_networks_plays_and_is_exported_and_nothing_begins_with_it(tiny, tmp_path):
    """As those of teams are whose second network takes over while the flag is held."""
    one = Network([np.zeros((1, 61, 17), np.float32)], [np.eye(17, dtype=np.float32)[3][None]], NONE, "tanh",
                  "discrete", 10, 61)  # fmt: skip
    path = write_weights(joined(one, one, np.array([8])), tmp_path / "pair.npz")
    with pytest.raises(ConfigError, match="holds two networks"):
        PpoTraining(read_config(tiny(start=str(path))), tmp_path / "run")
    result = run("export", path, "--interval", "5", "--out", tmp_path / "team.npz")
    assert result.exit_code == 0, result.output
    team = read_weights(tmp_path / "team.npz")
    assert (team.interval, team.carrying.interval) == (5, 5)
