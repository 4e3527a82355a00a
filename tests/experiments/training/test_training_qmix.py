import pytest
import torch
from steerclear.experiments.training.qmix import MonotoneMixer
from steerclear.experiments.training.two_step import learned_return


@pytest.mark.parametrize(("monotone", "earns"), [(True, 8.0), (False, 7.0)])
def test_the_two_step_game_has_its_known_answer(monotone, earns):
    torch.set_num_threads(1)
    assert learned_return(monotone, updates=400) == earns


def test_the_mixture_never_falls_where_a_value_rises():
    torch.manual_seed(0)
    mixer, state = MonotoneMixer(3, 5), torch.randn(64, 5)
    values = torch.randn(64, 3, requires_grad=True)
    mixer(values, state).sum().backward()
    assert float(values.grad.min()) >= 0.0
    assert float(values.grad.max()) > 0.0
