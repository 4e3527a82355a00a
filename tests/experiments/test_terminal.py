"""What goes to a terminal: nothing from outside is obeyed by it, and what it cannot show stops nothing."""

import io
import logging
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.table import Table
from rich.text import Text
from steerclear.experiments import cli, markdown, page
from steerclear.experiments.console import EVERY_S, ExitCode, PlainProgress, time_words
from steerclear.experiments.start import main
from steerclear.experiments.tables import titled
from steerclear.experiments.terminal import SafeConsole, SafeFormatter, plain
from steerclear.experiments.workers import fault_words, machine_words
from steerclear.shield.foreign import is_drawn, visible
from typer.testing import CliRunner

HOSTILE = [
    "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "\x9b2J", "[bold]b[/bold]", "[/red]", ":smile:", "\u202eevil", "\u2066x",
    "a\rb", "\x00", "\x08\x08", "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "$\\frac{", "a|b",
    "[x](javascript:alert(1))", "`rm`", "\ud800", "\u2028", "👩‍🚀",
]  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_only_shown_by_terminals_and_pages(name):
    for how in ("text", "Text", "cell", "title"):
        console = SafeConsole(file=io.StringIO(), width=120, force_terminal=True, color_system=None)
        table = Table("", title=Text(name) if how == "title" else None)
        table.add_row(name if how == "cell" else "")
        console.print({"text": name, "Text": Text(name)}.get(how, table))
        drawn = console.file.getvalue()
        assert all(is_drawn(letter) or letter == "\n" for letter in drawn)
        assert how in ("Text", "title") or visible(name) in drawn
    title = page.render("page.html", title=name).partition("<title>")[2].partition("</title>")[0]
    assert not {"<", '"'} & set(title)
    assert all(is_drawn(letter) or letter in "\n\t" for letter in title)
    assert not {"<", "\u202e"} & set(page.as_json({"title": name, name: [name]}))
    (_, _, row) = markdown.table(["a", "b"], [[name, "1 [0, 2]"]])
    assert row.replace("\\|", "").count("|") == 3
    assert not any(part in row for part in ("<script", "<img", "]("))
    assert row.isprintable()


@given(st.text())
def test_what_is_shown_is_drawn_and_shown_again_the_same(text):
    once = visible(text)
    assert all(map(is_drawn, once))
    assert visible(once) == once


@given(st.text())
def test_plain_text_is_ascii(text):
    assert plain(text).isascii()


def test_signs_are_written_by_their_meaning_and_the_log_shows_names():
    record = logging.LogRecord("a", logging.WARNING, "", 1, "boat %s", ("\x1b[2Jx",), None)
    assert SafeFormatter("%(message)s").format(record) == "boat \\x1b[2Jx"
    assert plain("54° → ±2 m… ≥ 3 µs ⚑") == "54 deg -> +-2 m... >= 3 us F"
    assert plain("│─┼━█⣿⠁⠀") == "|-+-##. "


SAY = """
import sys
from steerclear.experiments.start import main
from steerclear.experiments.terminal import prepare
prepare()
from steerclear.experiments.console import out, err
from steerclear.experiments.tables import titled
for console in (out(), err()):
    console.print(titled("54° → ⚑", ["", "≥"], [["\\u2800\\u28ff", "\\ud800…"]]))
"""


def test_a_terminal_without_unicode_stops_nothing(tmp_path):
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    (tmp_path / "say.py").write_text(SAY, encoding="utf-8")
    clean = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)} | environment
    done = subprocess.run(
        [sys.executable, "say.py"], cwd=tmp_path, env=clean, capture_output=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"54" in done.stdout
    assert b"54" in done.stderr


WITHOUT = """
import sys, os, signal
for name in ("termios", "fcntl", "resource", "pwd", "grp", "tty", "pty", "syslog", "crypt"):
    sys.modules[name] = None
for name in ("fork", "geteuid", "getuid", "killpg", "sched_getaffinity", "setsid", "tcgetpgrp", "getpgrp", "nice"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGKILL", "SIGHUP", "SIGQUIT"):
    delattr(signal, name)
from typer.testing import CliRunner
from steerclear.experiments import cli
import steerclear.shield.bridge.mavlink, steerclear.experiments.deploy.run
for command in [[], *[[info.name or info.callback.__name__.replace("_", "-")] for info in cli.app.registered_commands]]:
    done = CliRunner().invoke(cli.app, [*command, "--help"])
    assert done.exit_code == 0, (command, done.output, done.exception)
from steerclear.experiments.deploy.dashboard import Keyboard
assert not Keyboard(print).is_terminal
done = CliRunner().invoke(cli.app, ["ablate", "--opponents", "nobody"])
assert done.exit_code == 2, done.output
print("ok")
"""


def test_where_there_is_no_unix_commands_are_there_and_keys_are_not(tmp_path):
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, timeout=300, check=False, cwd=tmp_path)
    assert done.stdout.strip().endswith(b"ok"), done.stderr.decode()[-2000:]


def fails(error):
    def check(name):
        raise error

    return check


@pytest.mark.parametrize("error", [RuntimeError("a\nb \x1b[2J"), RecursionError()])
def test_what_nobody_foresaw_is_one_line_and_a_file(error, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.cli_games.run_games", fails(error))
    monkeypatch.setattr("steerclear.experiments.cli_games.AblationSettings", fails(error))
    monkeypatch.setattr("steerclear.experiments.cli_games.o.split_names", lambda *_: fails(error)(""))
    done = CliRunner().invoke(cli.app, ["evaluate", "medium"])
    assert done.exit_code == ExitCode.FAULT == 70
    assert done.stderr.count("\n") == 1
    assert "a fault of steerclear" in done.stderr
    assert "\x1b" not in done.output
    path = Path(done.stderr.split("traceback is in ")[1].split(": please")[0])
    assert "Traceback" in path.read_text(encoding="utf-8")
    path.unlink()
    monkeypatch.setattr(
        "steerclear.experiments.workers.tempfile.NamedTemporaryFile", lambda *a, **k: fails(OSError(28, "full"))("")
    )
    assert "could not be written (full)" in fault_words(RuntimeError(f"not {error}"))
    assert machine_words(error) == ""


@pytest.mark.parametrize("width", [80, 72, 60, 40])
def test_a_table_fits_the_terminal_and_loses_nothing(width):
    heads = ["", "shield off", "on, left to the game", "on - off, paired"]
    rows = [[f"figure {k}", f"{k}.25 [-10.1, 12]", "0.00 [0.00, 0.75]", f"-{k}.50 [-2.2, 0.75]"] for k in range(3)]
    console = SafeConsole(file=io.StringIO(), width=width)
    console.print(titled("A table", heads, rows))
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    shown = " ".join(" ".join(lines).split())
    assert "…" not in shown
    words = [word for row in (heads, *rows) for cell in row for word in cell.split()]
    assert all(shown.count(word) >= 1 for word in words)
    assert sum(line.startswith("figure 2") for line in lines) == (1 if width >= 60 else 2)


def test_long_words_of_a_goal_go_on_in_a_second_line():
    console = SafeConsole(file=io.StringIO(), width=50)
    console.print(titled("Goals", ["", "measured", "goal"], [["many words " * 9, "1.0", ">= 2"]], wrap=True))
    assert console.file.getvalue().count("words") == 9


def lines_of(told, at_once=False, least=1):
    """What is printed where (time s, done, words) are told."""
    file, now_s = io.StringIO(), [0.0]
    plain = PlainProgress("games", 1200, SafeConsole(file=file), at_once, least, lambda: now_s[0])
    for time_s, done, words in told:
        now_s[0] = time_s
        plain(done, words)
    return file.getvalue().splitlines()


def test_a_line_comes_now_and_then_with_the_time_that_is_left():
    told = [(0.0, 200, ""), (10.0, 250, ""), (EVERY_S + 10.0, 300, "net 2"), (EVERY_S + 11.0, 310, "")]
    assert lines_of(told) == ["games: 300 of 1,200, net 2, about 9 min left"]  # 50 in 30 s, 900 left
    assert [time_words(time_s) for time_s in (40.0, 11_100.0)] == ["40 s", "3 h 5 min"]


def test_the_first_is_printed_where_it_is_wanted_and_no_time_is_told_where_none_is_known():
    assert lines_of([(0.0, 0, ""), (1.0, 1, "")], at_once=True) == ["games: 0 of 1,200"]
    assert lines_of([(0.0, 5, ""), (40.0, 5, ""), (80.0, 1200, "")]) == ["games: 5 of 1,200", "games: 1,200 of 1,200"]


def test_the_time_left_is_told_once_games_have_a_rate_and_compiling_is_no_part_of_it():
    told = [(0.0, 0, ""), (130.0, 1, ""), (131.0, 2, ""), (161.0, 3, ""), (191.0, 5, "")]  # compiled for 2 minutes
    assert lines_of(told, least=2) == [
        "games: 1 of 1,200",
        "games: 3 of 1,200, about 5 h 9 min left",
        "games: 5 of 1,200, about 5 h 4 min left",
    ]
    assert lines_of(told[:2]) == ["games: 1 of 1,200"], "one game has no rate"


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
