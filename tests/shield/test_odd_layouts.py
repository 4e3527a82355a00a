"""However arrays are laid out, decisions are the same bits, and nothing is compiled anew for them."""

from dataclasses import replace

import numpy as np
import pytest
from shield_scenes import bits, signatures
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import FleetError
from steerclear.shield.platforms import layout as L
from test_arrays import read_only

FIELD = Surroundings((-40.0, -40.0, 40.0, 40.0), circles=[(20.0, 0.0, 3.0)])
WANTED = np.array([[2.0, 0.0], [2.0, 3.0]])


def exactly(array, kind):
    """The same numbers of another type, where that holds them."""
    with np.errstate(invalid="ignore"):
        return array.astype(kind) if (array.astype(kind) == array).all() else array


def spread(array):
    """The same numbers with a gap after each."""
    return np.repeat(array, 2, axis=-1)[..., ::2]


LAYOUTS = {
    "whole": lambda array: exactly(array, np.int64),
    "small": lambda array: exactly(array, np.float32),
    "Fortran": np.asfortranarray,
    "strided": spread,
    "read-only": read_only,
    "objects": lambda array: array.astype(object),
}


def meeting(laid):
    return Fleet.of(
        position_m=laid(np.array([[0.0, 0.0], [0.0, 5.5]])),
        heading_rad=laid(np.array([0.0, 3.0])),
        speed_mps=laid(np.array([2.0, 2.0])),
        team=laid(np.array([0.0, 1.0])),
        controlled=laid(np.array([1.0, 0.0])),
        age_s=laid(np.zeros(2)),
        position_error_m=laid(np.zeros(2)),
        platforms="heron",
    )


def directly(laid):
    fleet = meeting(np.asarray)
    names = ("state", "team", "controlled", "age_s", "position_error_m")
    return replace(fleet, **{name: laid(getattr(fleet, name)) for name in names})


def answer(laid, fleet_of):
    shield = Shield(ShieldConfig(), FIELD)
    decisions = shield.decide(fleet_of(laid), Commands(laid(WANTED), False))
    return bits(decisions.filtered.values), decisions.reason.tolist(), decisions.safety_margin_m.tolist()


@pytest.mark.parametrize("fleet_of", [meeting, directly])
@pytest.mark.parametrize("name", LAYOUTS)
def test_no_layout_changes_a_decision_or_is_compiled_for(name, fleet_of):
    expected, before = answer(np.asarray, fleet_of), signatures()
    assert sum(before.values()) > 5, "the count is of what has been compiled"
    assert answer(LAYOUTS[name], fleet_of) == expected
    assert signatures() == before


@pytest.mark.parametrize("name", LAYOUTS)
def test_batches_take_any_layout_too(name):
    def play(laid):
        shield = BatchedShield(ShieldConfig(), 2, ("heron", "heron"), (0, 1), FIELD)
        state = np.array([meeting(np.asarray).state] * 2)
        state[:, :, L.THRUST] = 100.0
        ours = np.array([[1.0, 0.0]] * 2)
        return shield.decide(laid(state), laid(np.array([[[2, 0], [2, 0]]] * 2, float)), laid(ours)).copy()

    expected, before = play(np.asarray), signatures()
    assert (expected[:, 0] != (2.0, 0.0)).any(axis=1).all(), "the boats would have met"
    assert bits(play(LAYOUTS[name])) == bits(expected)
    assert signatures() == before


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"wanted": "fast"}, "wanted is not an array of numbers"),
        ({"ours": np.full((1, 2), 2)}, "ours is not an array of True or False .*neither True nor False"),
        ({"state": np.zeros((1, 2, 3))}, "state has shape"),
    ],
)
def test_batches_refuse_what_is_none(change, text):
    shield = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 1))
    arrays = {"state": meeting(np.asarray).state[None], "wanted": np.zeros((1, 2, 2)), "ours": np.ones((1, 2), bool)}
    with pytest.raises(FleetError, match=text):
        shield.decide(**{**arrays, **change})
    with pytest.raises(FleetError, match="mask is int64"):
        shield.reset(np.array([0]))
