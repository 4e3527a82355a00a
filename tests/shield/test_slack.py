"""Slack of the program: what one boat cannot keep lets no other off."""

import numpy as np
import pytest
from steerclear.shield.linearised import add_slack, solve_compiled
from steerclear.shield.plan import new_plan
from steerclear.shield.program import Program, solve
from steerclear.shield.rows import BOX_ROW, FIXED_ROW, NOBODY, PAIR_ROW

ASKED = 0.5
"""What a row asks of the first input of the second boat."""


def two_boats(kind, others):
    """Program of two boats: the first has two rows that contradict each other, the second one that it can keep.

    ``others`` are the neighbours that the rows of the first and of the second are about: 0 and 1 take part, 2 not.
    """
    plan = new_plan(3, 8)
    plan.movers[:2], plan.place[:2] = (0, 1), (0, 1)
    rows = [(kind, 0, others[0], 0, 1.0, 1.0), (kind, 0, others[0], 0, -1.0, 1.0)]
    rows += [(kind, 1, others[1], 2, 1.0, ASKED), (BOX_ROW, NOBODY, NOBODY, 2, -1.0, -2.0)]
    for r, (sort, boat, other, column, sign, least) in enumerate(rows):
        plan.kind[r], plan.label[r, 0], plan.label[r, 1] = sort, boat, other
        plan.C[r, :4], plan.d[r] = 0.0, least
        plan.C[r, column] = sign
    return plan, len(rows)


@pytest.mark.parametrize(
    ("kind", "others", "let_off"),
    [
        (PAIR_ROW, (2, 2), False),
        (PAIR_ROW, (NOBODY, 2), False),  # an obstacle near in time
        (PAIR_ROW, (1, 2), False),  # among themselves the first two cannot, the second from another boat can
        (PAIR_ROW, (1, 0), True),  # rows between two that take part share theirs
        (FIXED_ROW, (NOBODY, NOBODY), False),
    ],
)
def test_a_boat_keeps_what_it_can_whatever_another_cannot(kind, others, let_off):
    plan, rows = two_boats(kind, others)
    assert solve_compiled(2, rows, plan)
    asked = solve(_with_slack(*two_boats(kind, others)), "daqp")
    np.testing.assert_allclose(plan.z[:4], asked[:4], atol=1e-6)
    assert plan.z[2] == pytest.approx(0.0 if let_off else ASKED, abs=0.01)
    assert abs(plan.z[0]) < 1.0 - 0.5  # what contradicts itself is what gives way


def _with_slack(plan, rows):
    n = add_slack(2, rows, plan)
    return Program(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n])


def test_limits_have_no_slack():
    plan, rows = two_boats(PAIR_ROW, (2, 2))
    n = add_slack(2, rows, plan)
    assert n == 9
    assert (plan.C[rows - 1, 4:n] == 0.0).all()
    assert (np.count_nonzero(plan.C[: rows - 1, 4:n], axis=1) == 1).all()
