"""STOP ALL and overrides: in force, told, logged, over by themselves."""

import logging
import threading

import pytest
from steerclear.shield.bridge.failsafe_table import DISABLES
from steerclear.shield.bridge.operator import LONGEST_OVERRIDE_S, Operator
from steerclear.shield.exceptions import ConfigError


def test_stop_all_is_in_force_until_taken_back(caplog):
    operator = Operator()
    with caplog.at_level(logging.WARNING):
        operator.stop_all("key")
        assert (operator.stopped, operator.hard) == ("key", False)
        operator.stop_all("key")
        assert operator.hard
        assert [action.condition for action in operator.actions(0.0)] == ["stop_all"]
        operator.resume()
    assert (operator.stopped, operator.hard, operator.actions(0.0)) == ("", False, ())
    assert "past the shield" in caplog.text


def test_an_override_says_what_it_disables_and_ends(caplog):
    operator = Operator()
    with caplog.at_level(logging.WARNING):
        operator.override("contact", "red_1", 30.0, now_s=100.0, by="key")
        (action,) = operator.actions(110.0)
        assert "20 s more" in action.text
        assert DISABLES["contact"] in action.text
        assert operator.active(129.9)
        assert operator.active(130.0) == ()
    assert "disables" in caplog.text
    assert "ended" in caplog.text


@pytest.mark.parametrize("seconds", [0.0, -1.0, LONGEST_OVERRIDE_S + 1.0, float("nan"), float("inf")])
def test_no_override_without_an_end(seconds):
    with pytest.raises(ConfigError, match="at most"):
        Operator().override("game", "", seconds, 0.0)


@pytest.mark.parametrize("condition", ["shield", "navigation", "link", ""])
def test_the_shield_and_own_navigation_cannot_be_overridden(condition):
    with pytest.raises(ConfigError, match="cannot be overridden"):
        Operator().override(condition, "", 10.0, 0.0)


def test_many_threads_at_once():
    operator = Operator()

    def work(k):
        for i in range(200):
            operator.override("contact", f"boat_{k}", 1.0 + i, 0.0)
            operator.active(0.5)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(operator.active(0.5)) == 4
