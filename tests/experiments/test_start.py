"""Ctrl-C while modules are loaded ends in words, as it does later."""

import sys

import pytest
from steerclear.experiments.start import main


class Loading:
    """Stands for the module of the command line, which raises while it is loaded."""

    def __init__(self, raises):
        self._raises = raises

    @property
    def main(self):
        self._raises()


def interrupted():
    raise KeyboardInterrupt


def interrupted_in_a_class():
    try:
        interrupted()
    except KeyboardInterrupt as error:
        raise RuntimeError("Error calling __set_name__") from error


def broken():
    raise RuntimeError("broken")


@pytest.mark.parametrize("raises", [interrupted, interrupted_in_a_class])
def test_an_interrupt_while_loading_is_one_word_and_130(raises, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "steerclear.experiments.cli", Loading(raises))
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_what_is_no_interrupt_is_not_taken_for_one(monkeypatch):
    monkeypatch.setitem(sys.modules, "steerclear.experiments.cli", Loading(broken))
    with pytest.raises(RuntimeError, match="broken"):
        main()
