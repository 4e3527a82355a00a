"""One mistake in each command line: it ends in one line that names the remedy, before anything is done."""

import json
import shlex
from pathlib import Path

import pytest
from steerclear.env.record import save
from steerclear.experiments import cli
from steerclear.experiments import cli_train as train
from steerclear.experiments.console import ExitCode
from steerclear.policies.entrants import learned
from steerclear.shield.extras import install_command
from typer.testing import CliRunner

MISTAKES = [
    # no such command, option or value
    ("ablat", "ablate"),
    ("--verson", "--version"),
    ("ablate surplus", "surplus"),
    ("ablate --gmes 3", "--games"),
    ("ablate --games three", "valid integer"),
    ("ablate --games 2.5", "valid integer"),
    ("ablate --games -1", "--games must be at least 1"),
    ("ablate --seed 1e3", "valid integer"),
    ("ablate --seed 1 --games 2 --seed 2", "--seed is given twice; give it once"),
    ("ablate --fixed-start --fixed-start", "--fixed-start is given twice"),
    ("encounters --family head_on --family corner", "--family is given twice; give it once, values joined by commas"),
    ("reach show --picture a.png --picture b.png", "--picture is given twice"),
    ("platform new a --out a.yaml --out b.yaml", "--out is given twice"),
    ("entry check a.zip --preset mctf2025 --preset mctf2026", "--preset is given twice"),
    ("replay a.mcap --json a.json --json b.json", "--json is given twice"),
    ("ablate --seed -5", "--seed must be 0 or more"),
    ("ablate --seed 99999999999999999999", "at most 4611686018427387904"),
    ("ablate --separation 2500", "if that is mm, give 2.5"),
    ("ablate --own medium --json rows.jsonl", ".json"),
    ("ablate --preset aamas", "aamas2024"),
    ("ablate --preset ''", "preset"),
    ("ablate --own ''", "policy"),
    ("ablate --own medum", "medium"),
    ("ablate --own a.zip", "solution.py"),
    ("ablate --own text.txt", "text.txt"),
    ("ablate --own a_folder", "a_folder"),
    ("ablate --own '[/red]'", "[/red]"),
    ("ablate --opponents ''", "separated by commas"),
    ("ablate --opponents easy,,hiden", "hidden"),
    ("ablate --platform canoe", "heron"),
    ("ablate --opponent-model turn", "turning_circle"),
    ("ablate --solver best", "daqp"),
    ("ablate --separation 0", "separation_m"),
    ("ablate --separation inf", "separation_m"),
    ("ablate --separation wide", "valid number"),
    ("ablate --shield-set separation_m", "KEY=VALUE"),
    ("ablate --shield-set =3", "KEY=VALUE"),
    ("ablate --shield-set alpha_per_s=fast", "alpha_per_s"),
    ("ablate --shield-set alpha_per_s=null", "alpha_per_s"),
    ("ablate --shield-set dt_s=[1,2]", "dt_s"),
    ("ablate --shield-set coordination=all", "coordination"),
    ("ablate --set team_size=0", "team_size"),
    ("ablate --set team_size=many", "team_size"),
    ("ablate --set team_size=1e9", "team_size"),
    ("ablate --set env_bounds_m=160", "env_bounds_m"),
    ("ablate --set env_bounds_m=[-1,2]", "env_bounds_m"),
    ("ablate --set max_time_s=true", "max_time_s"),
    ("ablate --set obstacles=rocks", "obstacles"),
    ("ablate --set dt_s=0", "dt_s"),
    ("ablate --max-time nan", "max_time_s"),
    ("ablate --max-time -3", "max_time_s"),
    ("ablate --penalty lots", "valid number"),
    ("ablate --penalty nan", "--penalty"),
    ("ablate --jobs 0", "--jobs"),
    ("ablate --jobs 99999999", "--jobs"),
    ("ablate --judge everyone", "shielded"),
    ("ablate --delay -1", "delay"),
    ("ablate --delay nan", "delay"),
    ("ablate --noise -1", "noise"),
    ("ablate --current 50", "current"),
    ("ablate --resume", "--out"),
    ("ablate --out text.txt --games 1", "text.txt"),
    ("ablate --out text.txt/deeper --games 1", "text.txt"),
    ("ablate --json a_folder", "a_folder"),
    ("ablate --json results.yaml", ".json"),
    ("evaluate", "POLICY"),
    ("evaluate medium hard", "hard"),
    ("evaluate nothing_here", "nothing_here"),
    ("evaluate ../../../../etc", "etc"),
    ("evaluate sb3:none.zip", "none.zip"),
    ("evaluate sb3:text.txt", "text.txt"),
    ("evaluate medium --opponents keyboard", "steerclear play"),
    ("evaluate medium --separation 2 --solver daqp", "--shield"),
    ("play --side green", "blue"),
    ("play --seed 99999999999999999999 --max-time 0.3", "at most"),
    ("play --save a.npz --save a.npz", "named twice by --save"),
    ("play --speed -1", "--speed"),
    ("play --no-shield --separation 5", "would change nothing"),
    ("play --no-shield --shield-set adversary_horizon_s=3", "would change nothing"),
    ("play --own sb3:", "sb3"),
    ("play --own keyboard --opponent nobody --headless", "nobody"),
    ("play --save game", ".npz"),
    ("play --save game.mov", ".mp4"),
    ("play --save text.txt/game.npz --max-time 0.3", "text.txt"),
    ("tournament --teams nobody,easy", "nobody"),
    ("tournament --repetitions 0", "repetitions"),
    ("demonstrate --opponent nobody", "easy or medium"),
    ("train nothing.yaml", "nothing.yaml"),
    ("export nothing.zip --out weights.npz", "nothing.zip"),
    ("train-study nothing.yaml --out studies", "nothing.yaml"),
    ("encounters --family head-on", "head_on"),
    ("encounters --family ','", "--family"),
    ("encounters --platform a/b/c", "own/other"),
    ("encounters --platform canoe", "heron"),
    ("encounters --guard shild", "shield"),
    ("encounters --guard shield:alpha", "KEY=VALUE"),
    ("encounters --guard shield:alpha_per_s=x", "alpha_per_s"),
    ("encounters --n 0", "--n"),
    ("encounters --radius 0", "radius"),
    ("encounters --radius nan", "radius"),
    ("encounters --seed -1", "seed"),
    ("encounters --seed 99999999999999999999", "at most"),
    ("encounters --n 1000000000", "at most 1,000,000"),
    ("encounters --workers 0", "--jobs"),
    ("encounters --scene none.json", "none.json"),
    ("encounters --scene text.txt", "text.txt"),
    ("encounters --scene a_folder", "a_folder"),
    ("encounters --scene list.json", "list.json"),
    ("encounters --scene text.txt --n 5", "--scene"),
    ("encounters --platform none.yaml", "platform new"),
    ("platform show canoe", "heron"),
    ("platform show none.yaml", "platform new"),
    ("platform check text.txt", "NAME.yaml"),
    ("platform new tub --from canoe", "heron"),
    ("platform new tub --from blubot", "did you mean blueboat"),
    ("platform show herron", "did you mean heron"),
    ("platform new tub --out tub.txt", ".yaml"),
    ("fit text.txt", "is no log"),
    ("fit none.csv", "none.csv"),
    ("fit none.csv --kind sail", "--kind"),
    ("fit none.csv --out boat.txt", ".yaml"),
    ("sea-trial none.yaml", "none.yaml"),
    ("sea-trial none.yaml --max-speed 0", "--max-speed"),
    ("sim-boats --demo --off 2", "0 to 0.9"),
    ("sim-boats --demo --really canoe", "heron"),
    ("sim-boats --demo --seed -1", "--seed must be 0 or more"),
    ("attack --attackers 9", "1 to 3"),
    ("attack --own 0", "1 to 6"),
    ("attack --restarts 0", "--restarts must be at least 1"),
    ("attack --restarts 1000000000", "at most 10,000"),
    ("attack --population 1000000000", "at most 10,000"),
    ("attack --generations 1000000000", "at most 10,000"),
    ("attack --population 0", "population"),
    ("attack --generations 0", "generations"),
    ("attack --platform heron,surveyor", "one --platform"),
    ("attack --guard none,shield", "one at a time"),
    ("attack --seed -1", "seed"),
    ("attack --radius -2", "radius"),
    ("attack --replay none.json", "none.json"),
    ("parity", "TRACES"),
    ("parity text.txt", "text.txt"),
    ("parity a_folder", "a_folder"),
    ("parity game.npz", "game.npz"),
    ("parity game.npz --jobs -2", "--jobs"),
    ("render", "RECORDS"),
    ("render none.npz", "none.npz"),
    ("render text.txt", "text.txt"),
    ("compare a_folder", "Missing argument"),
    ("ablate --shield-set separation_m=wide", "separation_m is 'wide'; give a number"),
    ("evaluate medium --shield --shield-set separation_m=null", "separation_m is None; give a number"),
    ("play --shield-set separation_m=[3]", "separation_m is [3]; give a number"),
    ("tournament --shield-set separation_m=wide", "separation_m is 'wide'; give a number"),
    ("entry report a_folder --shield-set separation_m=nan", "separation_m is"),
    ("compare a_folder a_folder", "give a results folder"),
    ("compare nowhere a_folder", "nowhere is no folder"),
    ("render a_folder", "a_folder"),
    ("render game.npz --to game.npz", "named twice"),
    ("render game.npz --to a_folder", "is a folder; name a file in it"),
    ("render game.npz --to text.txt/a.png", "text.txt"),
    ("render game.npz --to a.png --at -5", "--at"),
    ("render game.npz --to a.gif --speed 0", "speed"),
    ("render game.npz --to a.gif --speed nan", "speed"),
    ("render game.npz game.npz --to a.gif", "only a replay"),
    ("docs none", "none"),
    ("docs text.txt", "text.txt"),
    ("docs a_folder", "a_folder"),
    ("docs list.json", "list.json"),
    ("docs other.json", "results of 'play'"),
    ("docs --out text.txt", "text.txt"),
    ("docs game.npz", "game.npz"),
    ("bench --preset none", "known presets"),
    ("bench --seed -1", "--seed"),
    ("reach", "Usage"),
    ("reach solv", "solve"),
    ("reach solve heron", "--own"),
    ("reach solve --own canoe --other heron", "heron"),
    ("reach solve --own heron --other heron --other-may anything", "worst-case"),
    ("reach solve --own heron --other heron --radius -1", "radius"),
    ("reach solve --own heron --other heron --horizon 0", "horizon"),
    ("reach solve --own heron --other heron --out text.txt/a.npz --quick --horizon 1", "text.txt"),
    ("reach show --own heron --other canoe", "heron"),
    ("reach show --own heron --other heron --file none.npz", "none.npz"),
    ("reach show --own heron --other heron --file text.txt", "text.txt"),
    ("reach show --own surveyor --other surveyor --picture a.doc", ".png"),
    ("reach show --own surveyor --other surveyor --radius nan", "radius"),
    ("reach check none.npz", "none.npz"),
    ("reach compare --own heron --other canoe", "heron"),
    ("reach compare --own surveyor --other surveyor --radius 0", "radius"),
    ("reach compare --own surveyor --other surveyor --shield-set x=1", "x"),
    ("reach play --own canoe --other heron", "heron"),
    ("reach play --own surveyor --other surveyor --radius nan", "radius"),
    ("reach play --own surveyor --other surveyor --jobs 0", "--jobs"),
    ("deploy", "FLEET.yaml"),
    ("deploy none.yaml", "none.yaml"),
    ("deploy a_folder", "a_folder"),
    ("deploy text.txt", "text.txt"),
    ("deploy --demo --minutes 0", "--minutes"),
    ("deploy --demo --minutes nan", "--minutes"),
    ("deploy --demo --speed 0", "speed"),
    ("deploy --demo --policy nobody", "nobody"),
    ("deploy --demo --opponents nobody", "nobody"),
    ("deploy --demo --boat nobody", "nobody"),
    ("deploy --demo --seed -1", "--seed"),
    ("deploy --demo --wait -1", "wait"),
    ("preflight", "FLEET"),
    ("preflight none.yaml", "none.yaml"),
    ("preflight text.txt", "text.txt"),
    ("referee none.yaml", "none.yaml"),
    ("referee fleet.yaml --rate 0", "--rate"),
    ("referee fleet.yaml --minutes -1", "--minutes"),
    ("referee fleet.yaml --listen nowhere", "HOST:PORT"),
    ("referee fleet.yaml --publish :0", "HOST:PORT"),
    ("sim-boats", "FLEET.yaml"),
    ("sim-boats none.yaml", "none.yaml"),
    ("sim-boats --demo fleet.yaml", "--demo"),
    ("sim-boats --demo --wind strong", "m/s@deg"),
    ("sim-boats --demo --wind nan@0", "wind_mps"),
    ("sim-boats --demo --current 1@", "--current"),
    ("sim-boats --demo --noise -1", "noise"),
    ("sim-boats --demo --loss 2", "loss"),
    ("sim-boats --demo --delay -1", "delay"),
    ("sim-boats --demo --duration 0", "duration"),
    ("sim-boats --demo --speed nan", "speed"),
    ("sim-boats --demo --boot -1", "boot"),
    ("sim-boats --demo --fault blue_1", "BOAT:KIND@S"),
    ("sim-boats --demo --fault nobody:freeze@1", "nobody"),
    ("sim-boats --demo --fault blue_1:sink@1", "sink"),
    ("sim-boats --demo --opponents nobody", "nobody"),
    ("sim-boats --demo --record game.txt", ".npz"),
    ("replay", "LOG"),
    ("replay none.mcap", "none.mcap"),
    ("replay text.txt", "text.txt"),
    ("replay a_folder", "a_folder"),
    ("replay text.txt --html a.txt", ".html"),
    ("replay text.txt --record a.html", ".npz"),
    ("replay text.txt --mend a.npz", ".mcap"),
    ("warm-up now", "now"),
]


@pytest.fixture
def workplace(tmp_path, monkeypatch, game_record):
    """A folder with a few files, none of which is what it is given for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    Path("text.txt").write_text("wind from the west\n")
    Path("a_folder").mkdir()
    Path("list.json").write_text("[1, 2]")
    Path("other.json").write_text(json.dumps({"command": "play", "game": {}}))
    Path("a.zip").write_bytes(b"PK\x05\x06" + bytes(18))
    save(game_record, "game.npz")
    demo = Path(cli.__file__).parent / "templates" / "demo_fleet.yaml"
    Path("fleet.yaml").write_text(demo.read_text(encoding="utf-8"))
    return tmp_path


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_ends_in_one_line_that_names_the_remedy(line, words, workplace):
    before = sorted(workplace.rglob("*"))
    done = CliRunner().invoke(cli.app, shlex.split(line))
    said = " ".join(done.output.split())
    assert done.exit_code == ExitCode.BAD_INPUT, said
    assert isinstance(done.exception, SystemExit)
    assert "Traceback" not in said
    assert words.lower() in said.lower(), said
    if done.stderr.startswith("error:"):
        assert done.stderr.count("\n") == 1, "one line"
    left = [path.name for path in sorted(workplace.rglob("*")) if path not in before]
    assert left in ([], ["results"], ["logs"]), "nothing was done"


@pytest.mark.parametrize("line", ["train learn.yaml --out t", "train-study learn.yaml --out t"])
def test_who_learns_without_the_extra_is_told_which_it_is(line, workplace, monkeypatch):
    Path("learn.yaml").write_text((learned.TEAMS / "jin.yaml").read_text(encoding="utf-8"))
    monkeypatch.setattr(train, "find_spec", lambda name: None)
    done = CliRunner().invoke(cli.app, shlex.split(line))
    assert done.exit_code == ExitCode.BAD_INPUT, done.output
    assert install_command("train") in done.stderr
    assert not Path("t").exists()


def test_the_table_covers_every_command():
    named = {line.split()[0] for line, _ in MISTAKES}
    assert {info.name or info.callback.__name__.replace("_", "-") for info in cli.app.registered_commands} <= named
    assert len(MISTAKES) >= 80
