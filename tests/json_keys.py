"""Whether every key of real results stands on the page of JSON keys."""

import re

from steerclear.experiments.docs import KEYS

__all__ = ["KEYS", "undocumented"]


def undocumented(content, documented):
    """Key paths of ``content`` that ``documented`` does not describe."""
    patterns = [re.compile(_pattern(name)) for name in documented]
    return sorted({path for path in _paths(content) if not any(p.fullmatch(path) for p in patterns)})


def _paths(content, path=""):
    """Yield the path of every value: ``a.b[].c``."""
    if isinstance(content, dict) and content:
        for name, value in content.items():
            if name == "deprecated" and not path:  # earlier names
                continue
            yield from _paths(value, f"{path}.{name}" if path else str(name))
    elif isinstance(content, list | tuple) and content:
        for value in content:
            yield from _paths(value, f"{path}[]")
    elif not isinstance(content, dict | list | tuple):
        yield path


def _pattern(name):
    # settings may nest; elsewhere a star is one name (which may hold a dot, as in violations_opponent_2.5m)
    if name.endswith("settings.*"):
        return re.escape(name[:-1]) + ".+"
    return re.escape(name).replace(r"\*", r"[^\[\]]+?")
