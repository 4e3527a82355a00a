import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L


def put(core, positions):
    core.state[0, :, [L.X, L.Y]] = np.array(positions, dtype=float).T
    core.state[0, :, L.SPEED] = 0.0


def test_a_collision_counts_once_per_entry_for_both_boats(place, hold):
    core = place()
    apart = [(20, 10), (20, 30), (60, 10), (60, 30)]
    put(core, apart)
    hold(core)
    assert core.collisions.sum() == 0
    put(core, [(20, 10), (22.5, 10), *apart[2:]])
    hold(core, 3)
    assert core.collisions[0].tolist() == [1, 1, 0, 0]
    assert core.touching[0, 0, 1]
    put(core, apart)
    hold(core)
    put(core, [(20, 10), (22.4, 10), (21, 11), (60, 30)])
    hold(core)
    assert core.collisions[0].tolist() == [3, 3, 2, 0]
    assert core.new_collisions[0].tolist() == [2, 2, 2, 0]


def test_just_outside_the_sum_of_radii_is_no_collision(place, hold):
    core = place(overrides={"agent_radius_m": (1.0, 2.0, 1.0, 1.0)})
    put(core, [(20, 10), (23.001, 10), (60, 10), (60, 30)])
    hold(core)
    assert core.collisions.sum() == 0
    put(core, [(20, 10), (22.999, 10), (60, 10), (60, 30)])
    hold(core)
    assert core.collisions[0].tolist() == [1, 1, 0, 0]


@settings(derandomize=True, deadline=None, max_examples=10)
@given(st.integers(0, 1000))
def test_counts_agree_with_counting_entries_in_the_tracks(seed):
    config = GameConfig.preset("aamas2024", env_bounds_m=(30.0, 15.0), catch_radius_m=1.0, platforms="si", team_size=2)
    core = BatchedMctf(config.replace(agent_radius_m=0.6, flag_keepout_m=0.0), seed=seed)
    random = np.random.default_rng(seed)
    near = np.zeros((4, 4), dtype=bool)
    count = np.zeros(4, dtype=int)
    for _ in range(200):
        core.step(np.stack([random.uniform(0, 8, (1, 4)), random.uniform(-180, 180, (1, 4))], axis=-1))
        position = core.state[0, :, :2]
        now = np.linalg.norm(position[:, None] - position[None], axis=-1) <= 1.2
        np.fill_diagonal(now, False)
        count += (now & ~near).sum(axis=1)
        near = now
    np.testing.assert_array_equal(core.collisions[0], count)
