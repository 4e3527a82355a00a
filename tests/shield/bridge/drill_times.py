"""How soon each drill of the loop is answered, version by version, and the table of the documentation made of it.

`python tests/shield/bridge/drill_times.py now` measures this tree; `0.8.0 FOLDER` the tree of that version.
"""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
TIMES = Path(__file__).parent / "data" / "drill_times.json"
PAGE = ROOT / "docs" / "studies" / "boats.md"
MARKS = "<!-- drills -->\n", "\n<!-- /drills -->"
PROGRAM = """
import json, sys
sys.path[:0] = ["tests", "tests/shield", "tests/shield/bridge"]
from test_fault_figures import DRILLS, driven
found = {}
for name, (strike, answer, _, settings) in DRILLS.items():
    seen, world = driven(strike, dict(settings))
    when = [since for since, answers in seen if answer in answers and since >= -1e-6]
    words = "goes on" if answer is None else ": ".join(answer)
    closest_m = round(getattr(world, "closest_m", world), 2)
    found[name] = {"answer": words, "after_s": round(abs(when[0]), 1) if when else None, "closest_m": closest_m}
print(json.dumps(found))
"""


def times():
    """Answer, time until it is in effect and closest approach of each drill, by version, the oldest first."""
    return json.loads(TIMES.read_text())


def table(by_version):
    """The table of the documentation, in Markdown: times of all versions, distances of the last."""
    *_, now = by_version
    head = ["fault of one boat", "answer", *(f"after, {version}" for version in by_version), f"closest, {now}"]
    rows = [head, ["---"] * len(head)]
    for name, last in by_version[now].items():
        after = [measured[name]["after_s"] for measured in by_version.values()]
        shown = ["-" if seconds is None else f"{seconds:.1f} s" for seconds in after]
        rows.append([name, last["answer"], *shown, f"{last['closest_m']:.2f} m"])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main(version, tree=ROOT):
    """Measure a version and write what was found, and the table."""
    python = Path(tree) / ".venv" / "bin" / "python"
    done = subprocess.run([python, "-c", PROGRAM], cwd=tree, check=True, capture_output=True, text=True)
    known = times() if TIMES.exists() else {}
    known = dict(sorted((known | {version: json.loads(done.stdout.splitlines()[-1])}).items()))
    TIMES.write_text(json.dumps(known, indent=1) + "\n")
    before, rest = PAGE.read_text().split(MARKS[0])
    PAGE.write_text(f"{before}{MARKS[0]}{table(known)}{MARKS[1]}{rest.split(MARKS[1])[1]}")


if __name__ == "__main__":
    main(*sys.argv[1:])
