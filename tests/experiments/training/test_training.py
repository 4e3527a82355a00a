import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml
from steerclear import policies
from steerclear.experiments.cli import app
from steerclear.experiments.training.checkpoints import checkpoints_in, read_checkpoint, write_checkpoint
from steerclear.experiments.training.config_file import read_config
from steerclear.experiments.training.learner import DivergedError
from steerclear.experiments.training.training import Training
from steerclear.policies.entrants.learned import read_weights
from steerclear.shield.exceptions import ConfigError
from typer.testing import CliRunner


def without_time(curve):
    return [{name: value for name, value in row.items() if name != "wall"} for row in curve]


def stop_at(decisions):
    def stop(done, words):
        if done >= decisions:
            raise KeyboardInterrupt

    return stop


def trained(config, folder, resume=False):
    training = Training(read_config(config), folder, resume)
    training.run()
    return training


@pytest.fixture(scope="module")
def whole(tmp_path_factory, tiny_content):
    folder = tmp_path_factory.mktemp("whole")
    config = folder / "c.yaml"
    config.write_text(yaml.safe_dump(tiny_content))
    return trained(config, folder / "run"), folder / "run"


@pytest.fixture(scope="module")
def begun(tmp_path_factory, tiny_content):
    folder = tmp_path_factory.mktemp("begun")
    config = folder / "c.yaml"
    config.write_text(yaml.safe_dump({**tiny_content, "decisions": 36}))
    trained(config, folder / "run")
    return folder / "run"


def test_a_training_leaves_weights_curve_model_and_checkpoints(whole):
    training, folder = whole
    content = json.loads((folder / "curve.json").read_text())
    assert [row["decisions"] for row in content["rows"]] == [36, 72, 108, 144]
    assert training.stage == 1  # the first stage's rule is met at once
    assert {"net", "net_low", "net_high", "games"} <= content["rows"][-1]["evaluation"]["medium"].keys()
    assert len(checkpoints_in(folder)) == 2
    for name in ("best.npz", "final.npz", "model.zip"):
        assert (folder / name).stat().st_size > 0


@pytest.mark.parametrize("roles", ["shared", "placed", "each"])
def test_a_resumed_training_is_the_same_bit_for_bit(tiny, tmp_path, roles, whole):
    changes = {"net": {"hidden": [16], "roles": roles}}
    reference = whole[0] if roles == "shared" else trained(tiny(**changes), tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        Training(read_config(tiny(**changes)), tmp_path / "half").run(stop_at(72))
    again = trained(tiny(**changes), tmp_path / "half", resume=True)
    for one, two in zip(without_time(again.curve), without_time(reference.curve), strict=True):
        assert {name: (one.get(name), two[name]) for name in two if one.get(name) != two[name]} == {}
    for one, two in zip(reference.learner.network().weights, again.learner.network().weights, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_stage_may_have_rewards_of_its_own_and_no_shield_and_resumes_bit_for_bit(tiny, tmp_path):
    without = {"opponents": ["hold"], "games": 2, "net": -5, "shielded": False, "rewards": {"tagging": 0.5}}
    stages = [without, {"opponents": ["medium"], "rewards": {"sparse": 2.0}}]
    config = tiny(shield="training", shield_every=5, stages=stages)
    reference = Training(read_config(config), tmp_path / "whole")
    assert (reference.batch.shield, reference.batch._filter) == (None, None)
    assert reference.batch.reward.weights == {"sparse": 1.0, "progress": 1.0, "tagging": 0.5}
    reference.run()
    assert reference.stage == 1
    assert reference.batch.shield is not None
    assert reference.batch.reward.weights == {"sparse": 2.0, "progress": 1.0}
    for stop in (36, 72):
        with pytest.raises(KeyboardInterrupt):
            Training(read_config(config), tmp_path / "half", resume=True).run(stop_at(stop))
    again = trained(config, tmp_path / "half", resume=True)
    assert without_time(again.curve) == without_time(reference.curve)
    shield_s = [row["wall"]["shield_s"] for row in again.curve]
    assert (min(shield_s) == 0.0, shield_s[-1] > 0.0) == (True, True)


def test_a_stage_may_have_rules_of_its_own_and_resumes_bit_for_bit(tiny, tmp_path):
    alone = {"opponents": ["medium"], "games": 2, "net": -5, "rules": {"catch_radius_m": 5.0, "max_time_s": 9.0}}
    config = tiny(stages=[alone, {"opponents": ["medium"]}], shield="training", shield_every=5)
    reference = Training(read_config(config), tmp_path / "whole")
    assert (reference.batch.core.config.catch_radius_m, reference.batch.core.config.max_time_s) == (5.0, 9.0)
    reference.run()
    assert (reference.batch.core.config.catch_radius_m, reference.batch.core.config.max_time_s) == (10.0, 6.0)
    assert {row["stage"] for row in reference.curve} == {0, 1}
    for stop in (36, 108):
        with pytest.raises(KeyboardInterrupt):
            Training(read_config(config), tmp_path / "half", resume=True).run(stop_at(stop))
    again = trained(config, tmp_path / "half", resume=True)
    assert without_time(again.curve) == without_time(reference.curve)
    assert changes_of(again.learner.network(), reference.learner.network()) == 0.0


@pytest.mark.parametrize("rules", [{"team_size": 2}, {"env_bounds_m": [60.0, 40.0]}, {"platforms": "surveyor"}])
def test_rules_of_a_stage_by_which_boats_see_otherwise_are_refused(tiny, tmp_path, rules):
    config = tiny(stages=[{"opponents": ["hold"], "games": 2}, {"opponents": ["hold"], "rules": rules}])
    with pytest.raises(ConfigError, match="change what boats see"):
        Training(read_config(config), tmp_path / "run")


def test_a_resumed_training_knows_how_long_the_opponents_of_each_game_wait(tiny, tmp_path):
    config = tiny(stages=[{"opponents": ["medium"], "cooldown_s": [10, 40]}])
    begun = Training(read_config(config), tmp_path / "run")
    with pytest.raises(KeyboardInterrupt):
        begun.run(stop_at(72))
    resumed = Training(read_config(config), tmp_path / "run", resume=True)
    np.testing.assert_array_equal(resumed.batch.opponent.waits_s, begun.batch.opponent.waits_s)


@pytest.mark.parametrize("roles", ["placed", "each"])
def test_the_critic_may_learn_alone_at_first_and_a_resumed_training_knows_how_long(tiny, tmp_path, roles):
    config = tiny(ppo={"steps": 6, "batch": 18, "epochs": 2, "critic_first": 3}, net={"hidden": [16], "roles": roles})
    begun = Training(read_config(config), tmp_path / "run")
    at_first, critic = begun.learner.network(), critic_of(begun)
    with pytest.raises(KeyboardInterrupt):
        begun.run(stop_at(72))
    resumed = Training(read_config(config), tmp_path / "run", resume=True)
    with pytest.raises(KeyboardInterrupt):
        resumed.run(stop_at(108))
    assert changes_of(at_first, resumed.learner.network()) == 0.0
    assert max(float(np.abs(one - two).max()) for one, two in zip(critic, critic_of(resumed), strict=True)) > 0.0
    resumed.run()
    assert changes_of(at_first, resumed.learner.network()) > 0.0


def critic_of(training):
    """The critic's weights."""
    values = training.learner.model.policy.state_dict().items()
    return [value.numpy().copy() for name, value in values if "value" in name]


def changes_of(one, two):
    """Greatest change of an actor's numbers."""
    pairs = zip([*one.weights, *one.biases], [*two.weights, *two.biases], strict=True)
    return max(float(np.abs(a - b).max()) for a, b in pairs)


def test_an_unknown_reward_of_a_later_stage_is_found_before_the_first_rollout(tiny, tmp_path):
    stages = [{"opponents": ["hold"], "games": 2}, {"opponents": ["hold"], "rewards": {"capture": 1.0}}]
    with pytest.raises(ConfigError, match="unknown reward term 'capture'; did you mean captures"):
        Training(read_config(tiny(stages=stages)), tmp_path / "run")


def test_what_is_interrupted_is_kept_up_to_the_last_rollout(tiny, tmp_path):
    training = Training(read_config(tiny(checkpoint_every=100)), tmp_path / "run")

    with pytest.raises(KeyboardInterrupt):
        training.run(stop_at(72))
    facts, _ = read_checkpoint(checkpoints_in(tmp_path / "run")[-1])
    assert facts["decisions"] == 72
    assert len(json.loads((tmp_path / "run" / "curve.json").read_text())["rows"]) == 2


def test_an_evaluation_that_fails_loses_nothing_and_is_made_up_for(tiny, tmp_path, whole, monkeypatch):
    def failing(*arguments):
        raise RuntimeError("an opponent's file is gone")

    config, folder = tiny(evaluation={"every": 100, "games": 2}), tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr("steerclear.experiments.training.playing.play_games", failing)
        with pytest.raises(RuntimeError, match="is gone"):
            trained(config, folder)
    facts, _ = read_checkpoint(checkpoints_in(folder)[-1])
    assert facts["decisions"] == 144
    assert "evaluation" not in facts["curve"][-1]
    kept = read_weights(folder / "final.npz")
    gone_on = trained(config, folder, resume=True)
    assert gone_on.curve[-1]["evaluation"] == whole[0].curve[-1]["evaluation"]
    for mine, other in zip(kept.weights, read_weights(whole[1] / "final.npz").weights, strict=True):
        np.testing.assert_array_equal(mine, other)


def test_a_checkpoint_can_be_exported(whole, tmp_path):
    result = CliRunner().invoke(app, ["export", str(checkpoints_in(whole[1])[-1]), "--out", str(tmp_path / "team.npz")])
    assert result.exit_code == 0, result.output
    assert "for games of preset aamas2024" in result.output
    found, last = read_weights(tmp_path / "team.npz"), read_weights(whole[1] / "final.npz")
    assert (found.interval, found.kind, found.preset) == (last.interval, last.kind, "aamas2024")
    for mine, other in zip((*found.weights, *found.biases), (*last.weights, *last.biases), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_a_checkpoint_of_one_network_of_two_says_what_to_do(tmp_path):
    path = write_checkpoint(tmp_path, 1, {"settings": {"options": {"first": "a.npz"}}}, {})
    result = CliRunner().invoke(app, ["export", str(path), "--out", str(tmp_path / "team.npz")])
    assert result.exit_code == 2
    assert "--resume" in result.output


def test_a_loss_that_is_not_finite_ends_in_one_line_and_keeps_what_was(tiny, tmp_path, monkeypatch):
    training = Training(read_config(tiny()), tmp_path / "run")
    learn = training.learner.learn

    def poisoned():
        if training.rollouts == 1:
            for parameter in training.learner.model.policy.parameters():
                parameter.data.fill_(float("nan"))
        return learn()

    monkeypatch.setattr(training.learner, "learn", poisoned)
    with pytest.raises(DivergedError, match=r"no longer finite; lower ppo\.learning_rate"):
        training.run()
    facts, arrays = read_checkpoint(checkpoints_in(tmp_path / "run")[-1])
    assert facts["rollouts"] == 1
    assert all(np.isfinite(value).all() for name, value in arrays.items() if name.startswith("policy/"))


def test_a_damaged_or_foreign_checkpoint_is_refused_in_one_line(tiny, tmp_path, whole):
    folder = tmp_path / "run"
    Training(read_config(tiny(decisions=36)), folder).run()
    with pytest.raises(ConfigError, match="another net; resume with its own config"):
        Training(read_config(tiny(net={"hidden": [8]})), folder, resume=True)
    newest = checkpoints_in(folder)[-1]
    newest.write_bytes(newest.read_bytes()[:500])
    with pytest.raises(ConfigError, match=r"no whole checkpoint.*delete it"):
        Training(read_config(tiny(decisions=36)), folder, resume=True)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda facts, arrays: arrays.pop("counts"), "'counts' is missing"),
        (lambda facts, arrays: facts.pop("pool"), "'pool' is missing"),
        (lambda facts, arrays: facts.pop("settings"), "'settings' is missing"),
        (lambda facts, arrays: arrays.update(last_obs=arrays["last_obs"][:, :5]), "last_obs has another shape"),
        (lambda facts, arrays: arrays.pop("adam/1/exp_avg"), "'exp_avg' is missing"),
        (lambda facts, arrays: arrays.update({"adam/0/exp_avg": np.zeros(3, np.float32)}), "another shape"),
        (lambda facts, arrays: facts.update(rng={"kind": "MT19937"}), "'keys' is missing"),
        (lambda facts, arrays: facts.update(stage=99), "out of range"),
        (lambda facts, arrays: arrays.update(torch=np.zeros(7, np.uint8)), "RNG state size"),
    ],
)
def test_a_checkpoint_of_another_version_is_refused_and_kept(tiny, tmp_path, begun, change, words):
    folder = tmp_path / "run"
    shutil.copytree(begun, folder)
    newest = checkpoints_in(folder)[-1]
    facts, arrays = read_checkpoint(newest)
    change(facts, arrays)
    write_checkpoint(folder, int(newest.stem), facts, arrays)
    before = newest.read_bytes()
    with pytest.raises(ConfigError, match=rf"damaged or of another version.*{words}.*delete it") as caught:
        Training(read_config(tiny(decisions=36)), folder, resume=True)
    assert "\n" not in str(caught.value)
    assert newest.read_bytes() == before


def test_the_config_of_a_training_is_kept_where_another_is_refused(tiny, tmp_path, begun):
    folder = tmp_path / "run"
    shutil.copytree(begun, folder)
    (folder / "config.yaml").write_text("seed: 0\n")
    result = CliRunner().invoke(app, ["train", str(tiny(seed=5)), "--out", str(folder), "--resume"])
    assert result.exit_code == 2
    assert "another seed" in result.output
    assert (folder / "config.yaml").read_text() == "seed: 0\n"


def test_the_exported_model_plays_as_the_trained_one(whole, tmp_path):
    training, folder = whole
    import torch

    network, batch = read_weights(folder / "final.npz"), policies.make_batch(f"sb3:{folder / 'model.zip'}")
    seen = np.random.default_rng(0).uniform(-1, 1, (10_000, network.n_obs)).astype(np.float32)
    roles = np.zeros(len(seen), np.int64)
    policy = training.learner.model.policy
    with torch.no_grad():
        logits = policy.get_distribution(torch.as_tensor(seen)).distribution.logits.numpy()
    ours = network.outputs(seen, roles)
    assert np.abs((ours - ours.max(1, keepdims=True)) - (logits - logits.max(1, keepdims=True))).max() < 1e-5
    assert (np.argmax(ours, 1) == np.argmax(logits, 1)).all()
    assert batch.network.interval == network.interval == 10


def test_a_network_told_its_place_plays_as_it_learned_and_begins_another_training(tiny, tmp_path):
    import torch

    net = {"hidden": [16, 8], "roles": "placed"}
    training = trained(tiny(net=net, decisions=36), tmp_path / "placed")
    network = read_weights(tmp_path / "placed" / "final.npz")
    seen = np.random.default_rng(0).uniform(-1, 1, (300, network.n_obs)).astype(np.float32)
    roles = np.arange(300) % 3
    policy = training.learner.model.policy
    placed = torch.as_tensor(np.concatenate([seen, np.eye(3, dtype=np.float32)[roles]], axis=1))
    with torch.no_grad():
        logits = policy.get_distribution(placed).distribution.logits.numpy()
    ours = network.outputs(seen, roles)
    assert np.abs((ours - ours.max(1, keepdims=True)) - (logits - logits.max(1, keepdims=True))).max() < 1e-5
    again = Training(read_config(tiny(net=net, start=str(tmp_path / "placed" / "final.npz"))), tmp_path / "again")
    assert np.abs(again.learner.network().outputs(seen, roles) - ours).max() < 1e-5


@pytest.mark.parametrize("roles", ["shared", "placed"])
def test_a_wider_network_begins_exactly_as_the_one_it_starts_with_and_then_learns_with_all_of_it(tiny, tmp_path, roles):
    trained(tiny(net={"hidden": [16, 8], "roles": roles}, decisions=36), tmp_path / "narrow")
    path = tmp_path / "narrow" / "final.npz"
    narrow = read_weights(path)
    wide = Training(read_config(tiny(net={"hidden": [24, 20], "roles": roles}, start=str(path))), tmp_path / "wide")
    seen = np.random.default_rng(0).uniform(-1, 1, (300, narrow.n_obs)).astype(np.float32)
    before = wide.learner.network()
    assert before.weights[1].shape[1:] == (24, 20)
    np.testing.assert_allclose(
        before.outputs(seen, np.arange(300) % 3), narrow.outputs(seen, np.arange(300) % 3), atol=1e-5
    )
    wide.run()
    after = wide.learner.network()
    assert (after.weights[1][:, 16:, :8] != 0.0).all()
    assert (after.weights[2][:, 8:] != 0.0).all()
    again = tiny(net={"hidden": [16, 8], "roles": roles}, start=str(tmp_path / "wide" / "final.npz"))
    with pytest.raises(ConfigError, match="does not fit this network: a layer of shape"):
        Training(read_config(again), tmp_path / "again")


@pytest.mark.study
def test_kill_9_costs_nothing_but_the_rollouts_since_the_checkpoint(tiny, tmp_path):
    config, folder = tiny(), tmp_path / "run"
    words = [sys.executable, "-m", "steerclear.experiments.cli", "train", str(config), "--out", str(folder)]
    process = subprocess.Popen(words, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 240
    while not checkpoints_in(folder) and time.monotonic() < until:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    again = trained(config, folder, resume=True)
    reference = trained(config, tmp_path / "whole")
    assert without_time(again.curve) == without_time(reference.curve)
