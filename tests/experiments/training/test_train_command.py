import subprocess
import sys
import zipfile
from pathlib import Path

from commands import run as call
from filelock import FileLock
from steerclear.policies.submissions.made_for import made_for


def test_train_export_and_play_as_the_page_tells(tiny, tmp_path):
    folder = tmp_path / "first"
    assert call("train", tiny(decisions=36), "--out", folder).exit_code == 0
    again = call("train", tiny(decisions=36), "--out", folder)
    assert again.exit_code == 2
    assert "add --resume" in again.output
    files = "--out", tmp_path / "team.npz", "--submission", tmp_path / "solution.zip"
    exported = call("export", folder / "model.zip", *files)
    assert exported.exit_code == 0, exported.output
    assert exported.output.count("for games of preset aamas2024") == 2
    made = made_for(tmp_path / "solution.zip")
    assert (made.preset, made.shielded) == ("aamas2024", False)
    with zipfile.ZipFile(tmp_path / "solution.zip") as packed:
        assert "It learned in preset aamas2024. There is no shield in it" in packed.read("solution.py").decode()
    for policy in (f"weights:{tmp_path / 'team.npz'}", tmp_path / "solution.zip"):
        played = call("evaluate", policy, "--opponents", "hold", "--games", 1, "--max-time", 3,
                      "--jobs", 1, "--out", tmp_path / Path(str(policy)).stem)  # fmt: skip
        assert played.exit_code == 0, played.output
    for words in (
        ("entry", "check", tmp_path / "solution.zip", "--preset", "mctf2026", "--max-time", 3),
        ("play", "--own", f"weights:{tmp_path / 'team.npz'}", "--opponent", "hold", "--set", "team_size=2"),
    ):
        elsewhere = call(*words)
        assert elsewhere.exit_code == 2
        assert ("learned in preset aamas2024 and plays mctf2026" in elsewhere.output) == (words[0] == "entry")
        assert "take" in elsewhere.output
        assert "--preset aamas2024" in elsewhere.output


def test_a_training_without_a_terminal_tells_how_far_it_is(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.console.EVERY_S", 0.0)
    first = call("train", tiny(decisions=36), "--out", tmp_path / "run")
    assert first.exit_code == 0
    said = [line for line in first.stderr.splitlines() if line.startswith("decisions: ")]
    assert said[0] == "decisions: 0 of 36"
    for words in ("decisions: 36 of 36, stage ", "captures ", "against ", "hits ", "decisions/s"):
        assert words in said[-1]
    assert "nothing was left" not in first.stderr
    again = call("train", tiny(decisions=36), "--out", tmp_path / "run", "--resume")
    assert again.exit_code == 0
    assert "nothing was left to do: all 36 decisions were made before" in again.stderr


def test_a_training_has_its_folder_alone(tiny, tmp_path):
    (tmp_path / "alone").mkdir()
    with FileLock(tmp_path / "alone" / ".lock"):
        refused = call("train", tiny(), "--out", tmp_path / "alone")
    assert refused.exit_code == 2
    assert "another process" in refused.output


def test_a_shield_of_another_step_is_found_before_the_first_rollout(tiny, tmp_path):
    result = call("train", tiny(shield="deployment", shield_settings={"dt_s": 0.7}), "--out", tmp_path / "x")
    assert result.exit_code == 2
    assert "0.7 s" in result.output
    assert not list(tmp_path.glob("x/checkpoints/*"))


def test_playing_exported_weights_needs_no_torch():
    words = (
        "import sys; from steerclear.policies.entrants import learned; "
        "assert not any(name.split('.')[0] in ('torch', 'stable_baselines3') for name in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", words], timeout=120, check=False).returncode == 0
