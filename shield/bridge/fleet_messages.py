"""One line a person understands out of what pydantic found."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

LONGEST_NAME = 120
"""Of a place in the file, characters."""

WORDS_OF_A_PROGRAMMER = ("string_pattern_mismatch",)
"""Faults whose text is left out where the remedy says it."""

_SUBJECT = re.compile("^(Input|String|List|Tuple|Dictionary|Value)(?= should)")


def explain(error: ValidationError, root: type[BaseModel]) -> str:
    """The first fault with where it is and the remedy, and how many more there are."""
    faults = error.errors(include_url=False, include_context=True)
    faults.sort(key=lambda fault: fault["type"] != "extra_forbidden")  # a misspelt key explains the missing one
    text = _sentence(faults[0], root)
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _sentence(fault: Any, root: type[BaseModel]) -> str:
    place = tuple(fault["loc"])
    owner, entry = _find(root, place)
    name = _dotted(place)
    remedy = entry.description if entry is not None else None
    if fault["type"] == "extra_forbidden":
        known = [] if owner is None else list(owner.model_fields)
        near = get_close_matches(str(place[-1]), known, 1, 0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"
        return f"unknown key {name!r}; {hint}"
    if fault["type"] == "missing":
        return f"{name} is missing; {remedy or 'give it'}"
    said = "" if remedy and fault["type"] in WORDS_OF_A_PROGRAMMER else f": {_SUBJECT.sub('it', fault['msg'])}"
    return f"{name} is {_short(fault['input'])}{said}; {remedy or 'correct it'}"


def _find(root: type[BaseModel], place: tuple[int | str, ...]) -> tuple[type[BaseModel] | None, FieldInfo | None]:
    """The model that owns a place, and the field there as far as it is known."""
    owner: type[BaseModel] | None = root
    entry: FieldInfo | None = None
    for k, part in enumerate(place):
        if isinstance(part, int) or owner is None:
            continue
        found = owner.model_fields.get(part)
        if found is None:
            return owner, entry if k < len(place) - 1 else None
        entry = found
        inner = _model_in(found.annotation)
        if k < len(place) - 1 and inner is not None:
            owner = inner
    return owner, entry


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model inside ``X``, ``X | None``, ``tuple[X, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in get_args(annotation):
        found = _model_in(part)
        if found is not None:
            return found
    return None


def _dotted(place: tuple[int | str, ...]) -> str:
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 3]}..."


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
