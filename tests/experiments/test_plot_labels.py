"""Labels beside points that lie together are above each other; those elsewhere stay where they are."""

import itertools

from steerclear.experiments.plot_labels import GAP_POINTS, LETTER, LINE, label_points, offsets_of


def boxes(places, texts, size):
    offsets = offsets_of(places, texts, size)
    return [
        (x + right, x + right + LETTER * size * len(text), y + up)
        for (x, y), text, (right, up) in zip(places, texts, offsets, strict=True)
    ]


def test_labels_of_points_that_lie_together_do_not_cover_each_other():
    places = [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (3.0, 9.0), (200.0, 0.0)]
    found = boxes(places, ["12 / 8", "inf", "0", "3", "6"], 7.0)
    for (left, right, low), (other_left, other_right, other_low) in itertools.combinations(found, 2):
        apart = left >= other_right or other_left >= right or abs(low - other_low) >= LINE * 7.0 - 1e-9
        assert apart
    assert found[0][2] == GAP_POINTS
    assert found[4][2] == GAP_POINTS


def test_labels_are_written_beside_their_points():
    from matplotlib.figure import Figure

    axis = Figure(dpi=100).subplots()
    axis.plot([0.0, 1.0], [0.0, 0.0])
    label_points(axis, [(0.0, 0.0), (0.001, 0.0)], ["a", "b"])
    assert [text.xy for text in axis.texts] == [(0.0, 0.0), (0.001, 0.0)]
    assert axis.texts[1].get_position()[1] >= axis.texts[0].get_position()[1] + LINE * 7.0 - 1e-9
    label_points(axis, [], [])
