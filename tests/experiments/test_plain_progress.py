import io

from steerclear.experiments.console import EVERY_S, PlainProgress, time_words
from steerclear.experiments.terminal import SafeConsole


def lines_of(told, at_once=False):
    """What is printed where (time s, done, words) are told."""
    file, now_s = io.StringIO(), [0.0]
    plain = PlainProgress("games", 1200, SafeConsole(file=file), at_once, lambda: now_s[0])
    for time_s, done, words in told:
        now_s[0] = time_s
        plain(done, words)
    return file.getvalue().splitlines()


def test_a_line_comes_now_and_then_with_the_time_that_is_left():
    told = [(0.0, 200, ""), (EVERY_S - 1.0, 250, ""), (EVERY_S, 300, "net 2"), (EVERY_S + 1.0, 310, "")]
    assert lines_of(told) == ["games: 300 of 1,200, net 2, about 4 min left"]  # 100 in 30 s, 900 left: 4.5 min


def test_the_first_is_printed_where_it_is_wanted_and_no_time_is_told_where_none_is_known():
    assert lines_of([(0.0, 0, ""), (1.0, 1, "")], at_once=True) == ["games: 0 of 1,200"]
    assert lines_of([(0.0, 5, ""), (40.0, 5, ""), (80.0, 1200, "")]) == ["games: 5 of 1,200", "games: 1,200 of 1,200"]


def test_times_are_told_to_be_read():
    assert [time_words(time_s) for time_s in (40.0, 720.0, 11_100.0)] == ["40 s", "12 min", "3 h 5 min"]
