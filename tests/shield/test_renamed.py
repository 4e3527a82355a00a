import copy
import math
import pickle
from dataclasses import replace

import pytest
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.exceptions import FleetError
from steerclear.shield.renamed import DECISION, DECISIONS, PROFILES, SETTINGS, current_settings


@pytest.mark.parametrize(("old", "new"), SETTINGS.items())
def test_a_setting_is_taken_by_its_old_name_with_a_warning(old, new):
    value = "turning_circle" if old == "certificate" else 1500.0 if old == "search_limit" else 1.5
    for make in (ShieldConfig, ShieldConfig.of, lambda **one: Shield(**one).config):
        with pytest.warns(DeprecationWarning, match=f"'{old}' is now '{new}'"):
            config = make(**{old: value})
        assert getattr(config, new) == value
        with pytest.warns(DeprecationWarning, match=new):
            assert getattr(config, old) == value
    with pytest.warns(DeprecationWarning, match=new):
        assert getattr(replace(ShieldConfig(), **{old: value}), new) == value


@pytest.mark.parametrize(("old", "new"), PROFILES.items())
def test_a_profile_is_taken_by_its_old_name(old, new):
    with pytest.warns(DeprecationWarning, match=new):
        assert ShieldConfig(profile=old) == ShieldConfig(profile=new)


def test_decisions_are_read_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="adversary_horizon_s"):
        told = Fleet.of(
            position_m=[[0, 0], [0, 30]],
            heading_deg=[0, 180],
            speed_mps=[1, 1],
            team=[0, 1],
            platforms="heron",
            adversary_s=[math.nan, 3.0],
        )
    with pytest.warns(DeprecationWarning, match="adversary_horizon_s"):
        assert told.adversary_s is told.adversary_horizon_s
    decisions = Shield().decide(told, Commands.relative_deg([[1.0, 0.0]] * 2))
    for owner, names in ((decisions, DECISIONS), (decisions[0], DECISION)):
        for old, new in names.items():
            with pytest.warns(DeprecationWarning, match=f"'{old}' is now '{new}'"):
                assert getattr(owner, old) is getattr(owner, new)
        with pytest.raises(AttributeError, match="no attribute 'wnated'"):
            owner.wnated  # noqa: B018
        assert copy.copy(owner).reason is owner.reason
    assert pickle.loads(pickle.dumps(decisions[0])) == decisions[0]


def test_stored_settings_are_read_without_a_warning(caplog):
    stored = {"adversary_s": 5.0, "profile": "rammers", "separation_m": 4.0, "barriers": ["ferry"]}
    now = {"adversary_horizon_s": 5.0, "profile": "ramming", "separation_m": 4.0, "barriers": ["ferry"]}
    assert current_settings(stored) == current_settings(now) == now
    assert not caplog.text
    assert current_settings(stored, warned=True) == now
    assert "adversary_s is now adversary_horizon_s" in caplog.text
    assert "rammers is now ramming" in caplog.text


def test_decide_takes_nominal_commands_by_their_old_name_too_and_warns():
    fleet = Fleet.of(position_m=[[0, 0]], heading_rad=[0.0], speed_mps=[1.0], team=[0], platforms="heron")
    commands = Commands.absolute_deg([[1.0, 0.0]])
    with pytest.warns(DeprecationWarning, match="'wanted' is now 'nominal'"):
        old = Shield().decide(fleet, wanted=commands)
    assert (old.filtered.values == Shield().decide(fleet, commands).filtered.values).all()
    with pytest.raises(FleetError, match="decide takes a Fleet and Commands"):
        Shield().decide(fleet)
