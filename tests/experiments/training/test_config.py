"""What a config may say, of each algorithm, and in which words the rest is refused."""

from pathlib import Path

import pytest
import yaml
from steerclear.experiments.training.config import OPTIONS, Stage, config_of, read_config
from steerclear.shield.exceptions import ConfigError

ROOT = Path(__file__).parents[3]
TEAMS = sorted((ROOT / "policies" / "entrants" / "learned" / "teams").glob("*.yaml"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"presett": "aamas2024"}, "the config: unknown key 'presett'; did you mean preset"),
        ({"ppo": {"batchsize": 4}}, "unknown key 'ppo.batchsize'; choose one of|did you mean batch"),
        ({"stages": []}, "stages is"),
        ({"stages": [{"opponents": "medium"}]}, "stages.opponents is 'medium'; it should be"),
        ({"shield": "always"}, "shield is 'always'; it should be 'none', 'deployment'"),
        ({"games": 0}, "games is '0'; it should be greater than or equal to 1"),
        ({"games": 1, "rules": {"team_size": 1}, "ppo": {"steps": 1}}, "give more of ppo.steps or of games"),
        ({"stages": [{"cooldown_s": -1.0}]}, "stages.cooldown_s.*greater than or equal to 0"),
        ({"stages": [{"cooldown_s": [20, 10]}]}, "stages.cooldown_s.*give the least first"),
        ({"stages": [{"shielded": "no"}]}, "stages.shielded is 'no'; it should be a valid boolean"),
        ({"evaluation": {"opponents": ["self"]}}, "which is no policy; name held-out opponents"),
        ({"shield_settings": {"dwellll_s": 1}}, "unknown shield setting 'dwellll_s'"),
        ({"stages": [{"shield_settings": {"separation_m": 500}}]}, "the shorter side of the field, 40 m"),
        ({"rules": {"team_sizee": 2}}, "team_sizee"),
        ([], "the config is list; give keys and values"),
        ({"algorithm": "sac"}, "algorithm in the config is 'sac'; choose one of ppo, qmix, qmix.ppo, raids, cloning"),
        ({"algorithm": "qmix", "net": {"roles": "each"}}, "algorithm qmix has no use for net.roles; leave it out"),
        ({"algorithm": "qmix", "device": "cuda"}, "device is 'cuda'; it should be 'auto' or 'cpu'"),
        ({"algorithm": "qmix+ppo", "actions": "normalised"}, "actions is 'normalised'; it should be 'discrete'"),
        ({"algorithm": "qmix+ppo", "stages": [{"opponents": ["self"]}]}, "there are no snapshots at first"),
        ({"options": {"rate": 3.0}}, "algorithm ppo has no use for options; leave it out"),
        ({"algorithm": "raids", "stages": [{"opponents": ["self"]}]}, "there are no snapshots"),
        ({"algorithm": "raids", "stages": [{}, {}]}, "stages is of 2; algorithm raids learns in one"),
        ({"algorithm": "cloning", "decisions": 3}, "algorithm cloning has no use for decisions; leave it out"),
        ({"algorithm": "raids", "shield_every": 10}, "algorithm raids has no use for shield_every"),
        ({"algorithm": "raids", "stages": [{"net": 1.0}]}, "algorithm raids has no use for stages.net"),
        ({"algorithm": "raids", "options": {"rate": 1.0}}, "algorithm raids has no use for options.rate; leave it out"),
        ({"algorithm": "raids", "options": {"share": [1]}}, "unknown key 'options.share'; did you mean shares"),
        ({"algorithm": "raids", "options": {"shares": [0, 0, 0, 0, 0, 0]}}, "give one above 0"),
    ],
)
def test_what_a_config_may_not_say(content, words):
    with pytest.raises(ConfigError, match=words) as caught:
        config_of(content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", [*TEAMS, *(ROOT / "docs" / "studies").glob("*.yaml")], ids=lambda path: path.stem)
def test_every_config_of_the_repository_can_be_read(path):
    found = read_config(path)
    assert found.algorithm == yaml.safe_load(path.read_text()).get("algorithm", "ppo")
    weights = path.with_suffix(".npz")
    assert not weights.exists() or weights.stat().st_size <= 1_000_000
    assert config_of(found.told()) == found


def test_a_file_that_is_none(tmp_path):
    with pytest.raises(ConfigError, match="cannot read"):
        read_config(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="is no text in UTF-8"):
        read_config(tmp_path / "binary.yaml")


def test_the_intervention_term_comes_with_its_shield_mode():
    for shield, there in (("training+intervention", True), ("training", False)):
        assert ("intervention" in config_of({"shield": shield}).reward_weights(Stage())) is there


def test_every_algorithm_has_defaults():
    assert {config_of({"algorithm": name}).algorithm for name in OPTIONS} == set(OPTIONS)
