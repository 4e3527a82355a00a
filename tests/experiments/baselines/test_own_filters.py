"""Filters and barriers of a user's own that are not what is asked for: one clear error, never Python's."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from steerclear.experiments.baselines import barriers, textbook
from steerclear.experiments.baselines.barriers import BARRIERS, Barrier
from steerclear.experiments.baselines.registry import NoFilter
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.shield.exceptions import SteerclearError


class Own:
    """A filter that passes everything, but for what a test puts in its place."""

    def __init__(self, games, boats, answer=lambda nominal: nominal, **account):
        self.reason, self.safety_margin_m = np.zeros((games, boats)), np.zeros((games, boats))
        vars(self).update(account)
        self.answer = answer

    def decide(self, state, nominal, ours):
        return self.answer(nominal)


class ForgetsOurs(Own):
    def decide(self, state, nominal):
        return nominal


def measured(make_filter):
    return measure("head_on", make_filter, n=2, judge=False)


def own(kind=Own, **settings):
    return lambda config, games, platforms, team, around: kind(games, len(team), **settings)


MAKERS = {
    "a class": (NoFilter, r"NoFilter cannot be called as make_filter\(config, games, .*: too many positional.*lambda"),
    "a filter itself": (NoFilter(2, 2), "is NoFilter, a filter itself; expected a filter's name or make_filter"),
    "a number": (3, r"the safety filter is int; expected a filter's name or make_filter\(config, "),
    "nothing": (None, r"the safety filter is NoneType; expected"),
    "too few arguments": (lambda config: NoFilter(2, 2), r"cannot be called as make_filter\(config, games, platforms"),
    "one that makes nothing": (lambda *fleet: None, r"made NoneType; expected an object with decide\(state, nominal"),
    "one that makes a class": (lambda *fleet: NoFilter, "made the class NoFilter; expected an object with decide"),
    "decide no function": (own(decide=3), r"made Own; expected an object with decide\("),
    "decide without ours": (own(ForgetsOurs), r"ForgetsOurs.decide cannot be called as decide\(state, nominal, ours\)"),
    "answers of a game": (
        own(answer=lambda to: to[0]),
        r"Own.decide returned an array \(2, 2\); expected an array \(1",
    ),
    "answers a number": (
        own(answer=lambda to: 1.0),
        r"Own.decide returned a single number; expected an array \(1, 2, 2",
    ),
    "answers nothing": (own(answer=lambda to: None), r"Own.decide returned NoneType; expected an array \(1, 2, 2\)"),
    "answers words": (own(answer=lambda to: to.astype(str).astype("<U9").view("<U9") + "x"), "no number; expected"),
    "answers ragged": (own(answer=lambda to: [[1], [1, 2]]), r"Own.decide returned list; expected an array \(1, 2, 2"),
    "reason of a boat": (own(reason=np.zeros(2)), r"Own.reason is an array \(2,\); expected an array \(1, 2\)"),
    "reason no code": (own(reason=np.full((1, 2), 0.5)), "Own.reason holds what is no code; give whole numbers"),
    "reason too large": (own(reason=np.full((1, 2), 300)), "Own.reason holds what is no code"),
    "margin a number": (own(safety_margin_m=3.0), "Own.safety_margin_m is a single number; expected an array"),
}


@pytest.mark.parametrize("case", MAKERS)
def test_what_is_no_filter_is_named(case):
    make_filter, words = MAKERS[case]
    with pytest.raises(SteerclearError, match=words):
        measured(make_filter)


def test_a_class_that_takes_a_makers_arguments_is_a_maker():
    class Passing(NoFilter):
        def __init__(self, config, games, platforms, team, surroundings):
            super().__init__(games, len(team))

    scenes = draw("head_on", "heron", "heron", Conditions(), 0, 0, 2)
    played = play(scenes, Passing, Conditions())
    assert (played.filtered == played.nominal).all()
    assert measured(Passing).summary["changed_percent"] == 0.0


def test_the_filter_on_the_page_is_one():
    page = (Path(__file__).parents[3] / "docs" / "extend.md").read_text(encoding="utf-8")
    program, found = page.partition("```python\nclass Slow:")[2].partition("```")[0], {"np": np}
    exec(f"class Slow:{program}", found)
    assert measured(found["Slow"]).summary["changed_percent"] == 100.0
    assert measured("none").summary["changed_percent"] == 0.0


def test_an_error_of_a_makers_own_stays_its_own():
    def make_filter(*fleet):
        raise TypeError("mine")

    with pytest.raises(TypeError, match=r"^mine$"):
        measured(make_filter)


def pair(p, v, radius_m):
    return (p * p).sum(axis=0) - radius_m**2, 2.0 * p


def scalar(p, v, radius_m):
    return 1.0, 2.0 * p, 2.0 * p


def summed(p, v, radius_m):
    return (p * p).sum(axis=0), (2.0 * p).sum(axis=0), 2.0 * p


def of_a_gain(p, v, radius_m, rate):
    return (p * p).sum(axis=0) - rate, 2.0 * p, 2.0 * p


def h_alone(p, v, radius_m):
    return SimpleNamespace(h=1.0)


JETS = {
    "two values": (pair, ((0.5,),), r"function pair returned .*; expected three arrays: h \(.*\), its gradients in p"),
    "h a number": (scalar, ((0.5,),), "function scalar returned a single number, an array .*; expected three arrays"),
    "a gradient summed": (summed, ((0.5,),), "function summed returned .*; expected three arrays"),
    "a gain less": (
        of_a_gain,
        ((0.5,),),
        r"of_a_gain cannot be called as of_a_gain\(p, v, radius_m\): missing",
    ),
    "a gain more": (pair, ((0.5, 1.0),), r"pair cannot be called as pair\(p, v, radius_m, gain_2\): too many"),
    "no list": (h_alone, ((0.5,),), "function h_alone returned SimpleNamespace; expected three arrays"),
}


@pytest.mark.parametrize("case", JETS)
def test_a_barriers_function_that_gives_something_else_is_named(case, monkeypatch):
    jet, tried, words = JETS[case]
    monkeypatch.setitem(BARRIERS, "mine", Barrier(jet, tuned={}, tried=tried))
    with pytest.raises(SteerclearError, match=words):
        measured(lambda *fleet: textbook.TextbookFilter("mine", *fleet[:4]))


BUILT = {
    "without gains": (lambda: Barrier(pair, {}), "Barrier was called without tried; it takes jet, tuned, tried"),
    "misspelt": (lambda: Barrier(pair, {}, tries=((0.5,),)), "Barrier has no tries=; did you mean tried="),
    "no function": (lambda: Barrier("velocity_cbf", {}, ((0.5,),)), "jet is str; give a function of"),
    "no gains": (lambda: Barrier(pair, {}, ()), r"tried is \(\); give at least one tuple of gains"),
    "a gain alone": (lambda: Barrier(pair, {}, 0.5), r"tried is 0.5; give at least one tuple of gains, as tried=\(\("),
    "gains in no tuple": (
        lambda: Barrier(pair, {}, (0.5,)),
        r"one of tried is 0.5; give numbers .* as \(0.5,\), alpha",
    ),
    "other lengths": (lambda: Barrier(pair, {}, ((0.5,), (0.5, 1.0))), "2 gains where others are 1"),
    "tuned of other length": (
        lambda: Barrier(pair, {"heron": (1.0, 2.0)}, ((0.5,),)),
        r"tuned\['heron'\] is .*2 gains",
    ),
    "tuned no dict": (lambda: Barrier(pair, ((0.5,),), ((0.5,),)), "tuned is .*; give gains by platform"),
    "tuned for nobody": (
        lambda: Barrier(pair, {"heronn": (0.5,)}, ((0.5,),)),
        r"tuned\['heronn'\]: unknown platform 'heronn'; did you mean heron",
    ),
    "words": (lambda: Barrier(pair, {}, (("fast",),)), r"one of tried is \('fast',\); give numbers"),
    "not finite": (lambda: Barrier(pair, {}, ((float("nan"),),)), "one of tried is .*; give numbers"),
}


@pytest.mark.parametrize("case", BUILT)
def test_a_barrier_without_sound_gains_is_named(case):
    build, words = BUILT[case]
    with pytest.raises(SteerclearError, match=words):
        build()


@pytest.mark.parametrize("gains", [0.5, ("fast",), (), (float("inf"),)])
def test_gains_of_a_filter_are_numbers(gains):
    with pytest.raises(SteerclearError, match=r"gains of velocity_cbf is .*; give numbers"):
        measured(lambda *fleet: textbook.TextbookFilter("velocity_cbf", *fleet[:4], gains=gains))


def test_barriers_there_are_pass():
    for barrier in barriers.BARRIERS.values():
        assert barrier.count == len(barrier.tried[0])


ASKED = {
    "family no name": ({"family": 3}, "the family is 3; give the name of one"),
    "family a list": ({"family": ["head_on"]}, r"the family is \['head_on'\]; give the name of one"),
    "n in words": ({"n": "20"}, "the number of encounters is '20'; give a whole number"),
    "half an encounter": ({"n": 2.5}, "the number of encounters is 2.5; give a whole number"),
    "seed below 0": ({"seed": -1}, "seed is -1; give a whole number, 0 or more"),
    "seed in words": ({"seed": "x"}, "seed is 'x'; give a whole number"),
    "first in words": ({"first": "x"}, "first is 'x'; give a whole number"),
    "conditions a dict": ({"conditions": {"radius_m": 2.5}}, r"conditions is \{.*; give Conditions\(radius_m="),
}


@pytest.mark.parametrize("case", ASKED)
def test_other_arguments_are_named_too(case):
    given, words = ASKED[case]
    with pytest.raises(SteerclearError, match=words):
        measure(**{"family": "head_on", "n": 1, "judge": False, **given})


def test_conditions_have_names():
    with pytest.raises(SteerclearError, match="Conditions has no radius=; did you mean radius_m="):
        Conditions(radius=2.5)
