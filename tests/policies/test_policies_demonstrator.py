"""A person's choices become options that are followed, and rows."""

from steerclear.env.mctf import MctfEnv
from steerclear.policies.entrants.demonstrator import Demonstrator

BLUE = ["agent_0", "agent_1", "agent_2"]


def test_keys_choose_boat_and_option_once_each_time_they_go_down():
    env = MctfEnv("aamas2024")
    observations, infos = env.reset(seed=1)
    pressed = iter([set(), {"w"}, {"1"}, {"1"}, {"6"}, set()])
    said = []
    team = Demonstrator(keys=lambda: next(pressed), say=said.append)
    team.reset(env, BLUE, 0)
    for _ in range(6):
        actions = team.act(observations, infos)
    assert set(actions) == set(BLUE)
    assert said == ["boat 2: attack", "boat 2 cannot begin tag now"]
    chosen = [row for row in team.rows if row["chosen"]]
    assert [(row["boat"], row["option"]) for row in chosen] == [(1, "attack")]
    assert {"own_x", "mate1_heading", "foe2_tagged", "goal_x", "flag_taken"} <= set(chosen[0])
