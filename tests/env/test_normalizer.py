import numpy as np
import pytest
from steerclear.env.infos import VectorNormalizer
from steerclear.shield.exceptions import GameError


@pytest.fixture
def normalizer():
    low, high = np.array([-180.0, -5.0, -5.0, 0.0]), np.array([180.0, 85.0, 45.0, 2.0])
    return VectorNormalizer(["bearing", ("agent_0", "pos"), "speed"], [1, 2, 1], low, high)


def test_there_and_back(normalizer):
    entries = {"speed": 0.5, ("agent_0", "pos"): [40.0, 20.0], "bearing": -90.0}
    vector = normalizer.normalized(entries)
    np.testing.assert_allclose(vector, [-0.5, 0.0, 0.0, -0.5])
    assert normalizer.normalized_space.contains(vector)
    back = normalizer.unnormalized(vector)
    assert list(back) == ["bearing", ("agent_0", "pos"), "speed"]
    np.testing.assert_allclose(back[("agent_0", "pos")], (40.0, 20.0))
    assert back["speed"] == 0.5
    np.testing.assert_array_equal(normalizer.flattened(entries), np.float32([-90.0, 40.0, 20.0, 0.5]))
    assert normalizer.flattened_length == 4
    assert normalizer.is_angle.tolist() == [True, False, False, False]


def test_values_beyond_the_bounds_are_clipped(normalizer):
    assert normalizer.normalized({"bearing": 0.0, ("agent_0", "pos"): (999.0, 0.0), "speed": 9.0})[[1, 3]].max() == 1.0


def test_missing_entries_and_wrong_lengths_are_refused(normalizer):
    with pytest.raises(GameError, match=r"entries are missing: \['speed'\]"):
        normalizer.normalized({"bearing": 0.0, ("agent_0", "pos"): (0.0, 0.0)})
    with pytest.raises(GameError, match=r"shape \(3,\); give \(4,\)"):
        normalizer.unnormalized(np.zeros(3))
