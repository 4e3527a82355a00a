"""Arrays of any kind become one type and one layout, exactly, or are refused."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from shield_scenes import bits, signatures
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.arrays import NoNumbersError, numbers, truths, whole_numbers
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import FleetError

PLAIN = np.array([[2.0, 0.25], [1.0, -3.0]])


class Frame:
    """Anything that knows how to be an array."""

    def __array__(self, dtype=None, copy=None):
        return np.asfortranarray(PLAIN).astype(dtype or np.float64)


def read_only(array):
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def unaligned(array):
    raw = np.zeros(array.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(array.shape)
    raw[:] = array
    return raw


ODD = {
    "list": PLAIN.tolist(),
    "tuples": tuple(map(tuple, PLAIN.tolist())),
    **{kind: PLAIN.astype(kind) for kind in ("float32", "float16", "longdouble", ">f8", "object")},
    "Fortran": np.asfortranarray(PLAIN),
    "strided": np.repeat(PLAIN, 2, axis=1)[:, ::2],
    "read-only": read_only(PLAIN),
    "unaligned": unaligned(PLAIN),
    "decimals": [[Decimal("2"), Decimal("0.25")], [1, Decimal("-3")]],
    "unmasked": np.ma.masked_array(PLAIN),
    "frame": Frame(),
}


@pytest.mark.parametrize("kind", ODD)
def test_numbers_of_any_kind_are_the_same_numbers(kind):
    found = numbers(ODD[kind])
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.flags.carray
    assert found.tobytes() == PLAIN.tobytes()


def test_what_fits_already_is_not_copied():
    for brought, array in ((numbers, PLAIN), (truths, np.ones(2, bool)), (whole_numbers, np.arange(3))):
        assert brought(array) is array


def test_tensors_lose_their_gradient_and_nothing_else():
    torch = pytest.importorskip("torch")
    for tensor in (
        torch.tensor(PLAIN, requires_grad=True),
        torch.tensor(PLAIN, dtype=torch.bfloat16),
        [torch.tensor(row, requires_grad=True) for row in PLAIN],
        [[torch.tensor(value, requires_grad=True) for value in row] for row in PLAIN.tolist()],
    ):
        assert numbers(tensor).tobytes() == PLAIN.tobytes()
    for value in (torch.tensor([True, False]), [torch.tensor(True), 1.0]):
        with pytest.raises(NoNumbersError, match="some are True or False"):
            numbers(value)
    assert truths(torch.tensor([True, False])).tolist() == [True, False]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("12", "texts"),
        (b"12", "texts"),
        (np.array(["1.0", 2.0], dtype=object), "texts"),
        ([1.0 + 2.0j], "complex"),
        ([[1.0], [2.0, 3.0]], "inhomogeneous"),
        (np.ma.masked_array([1.0, 2.0], mask=[True, False]), "masked"),
        (np.zeros(2, "datetime64[s]"), "datetime64"),
        ({"x": 1.0}, "dict"),
        ([10**400], "too large"),
        (object(), "float"),
    ],
)
def test_what_holds_no_numbers_is_refused(value, text):
    for brought in (numbers, truths, whole_numbers):
        with pytest.raises(NoNumbersError, match=text):
            brought(value)


@pytest.mark.parametrize(
    "value",
    [True, np.True_, [True, 2.0], [[0.0, np.False_]], np.zeros(2, bool), [np.zeros(2, bool)], np.array([True, None])],
)
def test_true_and_false_are_numbers_only_where_that_is_said(value):
    with pytest.raises(NoNumbersError, match="some are True or False"):
        numbers(value)
    assert numbers(value, bools=True).dtype == np.float64


@pytest.mark.parametrize("value", [[2**63 - 1], [np.int64(-(2**63))], np.array([2**53 + 1]), np.uint64([7]), [True]])
def test_whole_numbers_are_exact(value):
    assert whole_numbers(value).tolist() == [int(value[0])]


@pytest.mark.parametrize(
    "value", [[2**63], [2**64], [-(2**63) - 1], [0.5], [np.nan], [np.inf], [2.0**60], [1e300], np.uint64([2**63])]
)
def test_whole_numbers_that_are_none_or_too_large_are_refused(value):
    with pytest.raises(NoNumbersError, match=r"a (value|number)"):
        whole_numbers(value)


def test_truths_may_be_told_by_one_and_nought_and_by_nothing_else():
    for value in ([1, 0], [1.0, 0.0], np.array([True, False]), read_only(np.array([True, False]))):
        found = truths(value)
        assert (found.dtype, found.flags.carray, found.tolist()) == (np.bool_, True, [True, False])
    for value in ([2, 0], [np.nan, 1.0], [0.5, 0.0]):
        with pytest.raises(NoNumbersError, match="neither True nor False"):
            truths(value)
    assert np.isnan(numbers([None, 1.0])[0]), "None is no number, as numpy has it"


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


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"nominal": "fast"}, "nominal is not an array of numbers"),
        ({"ours": np.full((1, 2), 2)}, "ours is not an array of True or False .*neither True nor False"),
        ({"state": np.zeros((1, 2, 3))}, "state has shape"),
    ],
)
def test_batches_refuse_what_is_none(change, text):
    shield = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 1))
    arrays = {"state": meeting(np.asarray).state[None], "nominal": np.zeros((1, 2, 2)), "ours": np.ones((1, 2), bool)}
    with pytest.raises(FleetError, match=text):
        shield.decide(**{**arrays, **change})
    with pytest.raises(FleetError, match="mask is int64"):
        shield.reset(np.array([0]))
