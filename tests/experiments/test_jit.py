"""Compiled functions of the experiments are compiled again when a source beside them changes."""

from pathlib import Path

import pytest
from steerclear.experiments import jit
from test_imports import FILES, GRAPH


def test_a_changed_added_or_renamed_source_gives_another_digest(tmp_path):
    seen = {jit.digest_of({tmp_path})}
    for name, text in (("a.py", "x = 1"), ("a.py", "x = 2"), ("b.py", "x = 2")):
        (tmp_path / name).write_text(text)
        seen.add(jit.digest_of({tmp_path}))
    (tmp_path / "b.py").rename(tmp_path / "c.py")
    seen.add(jit.digest_of({tmp_path}))
    assert len(seen) == 5
    (tmp_path / "notes.txt").write_text("no source")
    assert jit.digest_of({tmp_path}) in seen


def test_the_stamp_of_a_kernel_holds_the_digest_of_its_folder_and_of_those_it_may_call(monkeypatch):
    def stamp():
        jit._digest_beside.cache_clear()
        return jit.kernel(one_more)._cache.stamp

    asked = []
    monkeypatch.setattr(jit, "digest_of", lambda folders: asked.append(folders) or "digest")
    assert stamp()[-1] == "digest"
    here = Path(jit.__file__).parent
    assert asked[0] == {Path(__file__).parent, *(here / folder for folder in jit.FOLDERS)}
    monkeypatch.setattr(jit, "digest_of", lambda folders: "another")
    assert stamp()[-1] == "another"
    jit._digest_beside.cache_clear()


PLAIN = {"baselines.batch_guard"}
"""Modules of which compiled functions get nothing."""


def test_what_compiled_functions_get_from_elsewhere_is_in_the_folders():
    prefix, kernels = "steerclear.experiments.", "steerclear.experiments.jit"
    strangers = set()
    for name, others in GRAPH.items():
        if kernels in others and name.startswith(prefix):
            own = FILES[name].parent
            beside = {own, *(Path(jit.__file__).parent / folder for folder in jit.FOLDERS)}
            ours = {other for other in others if other.startswith(prefix) and other != kernels}
            strangers |= {other.removeprefix(prefix) for other in ours if FILES[other].parent.resolve() not in beside}
    assert strangers - PLAIN == set()


def one_more(x):
    return x + 1


def test_kernels_compute():
    assert jit.kernel(one_more)(1.5) == pytest.approx(2.5)
