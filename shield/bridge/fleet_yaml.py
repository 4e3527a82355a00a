"""The text of a FLEET.yaml as plain settings: YAML 1.2's core schema, and of that only what all programs read alike.

YAML 1.1 and 1.2 disagree about what a plain word means: ``010`` is 8 or 10, ``5:30`` is 330 or a text, ``yes`` is true
or a text. Such words are refused with the remedy; so are tags, merge keys and whatever is too large to be a fleet file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, NoReturn

import yaml

from ..exceptions import FleetFileError

MOST_BYTES = 128 << 10
"""Largest text, bytes: 64 boats with all their settings take a tenth."""
DEEPEST = 12
"""Settings lie at most so deep."""
MOST_NODES = 20_000
"""Values, each alias counted as all that it stands for."""
LONGEST_TEXT = 1000
"""Of one value, characters."""
LONGEST_NUMBER = 32
"""Digits and signs of a number."""

_WORDS: dict[str, bool | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
_WORDS |= {word: word.lower() == "true" for word in ("true", "True", "TRUE", "false", "False", "FALSE")}
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_REAL = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NO_NUMBER = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
"""Some settings of the shield may be endless; keys that may not say so themselves."""
_CORE_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|0o[0-7]+|0x[0-9a-fA-F]+")
"""All that YAML 1.2 takes for a number: with leading zeros or another base, 1.1 does not agree."""
_LINE_ENDS = re.compile("[\x85\u2028\u2029]")
"""They end a line in YAML 1.1 only: what is a comment in the one is a setting in the other."""
_TEXT_TAG = "tag:yaml.org,2002:str"


def read_settings(text: str) -> Any:
    """The settings of a text: mappings with text keys, lists, texts, numbers, true, false and null.

    Args:
        text: YAML, one document.

    Raises:
        FleetFileError: it is no YAML, says something that other programs read otherwise, gives a key twice, or is
            too large or too deep; one line that names the line and the remedy.
    """
    if not isinstance(text, str):
        raise FleetFileError(f"it is {type(text).__name__}; give its text")
    if len(text) > MOST_BYTES or len(text.encode(errors="replace")) > MOST_BYTES:
        raise FleetFileError(f"it is larger than {MOST_BYTES >> 10} KiB; give a fleet file")
    line_end = _LINE_ENDS.search(text)
    if line_end:
        line = text.count("\n", 0, line_end.start()) + 1
        raise FleetFileError(
            f"line {line}: programs disagree about whether U+{ord(line_end[0]):04X} ends a line; use newlines"
        )
    try:
        return _Builder(text).document()
    except yaml.YAMLError as error:
        raise FleetFileError(_one_line(error)) from None


class _Builder:
    """Makes values of the parser's events, one document's; see `read_settings`."""

    def __init__(self, text: str) -> None:
        self._loader = yaml.SafeLoader(text)  # the one in Python: it reads the same on every machine
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._nodes = 0

    def document(self) -> Any:
        """The only document's value; None for an empty text."""
        events = self._events()
        next(events)  # the stream's start
        if isinstance(next(events), yaml.StreamEndEvent):
            return None
        value = self._value(next(events), events, 1)
        next(events)  # the document's end
        extra = next(events)
        if not isinstance(extra, yaml.StreamEndEvent):
            _refuse(extra, "a second document begins; give one")
        return value

    def _events(self) -> Iterator[Any]:
        try:
            while self._loader.check_event():
                yield self._loader.get_event()
        finally:
            self._loader.dispose()

    def _value(self, event: Any, events: Iterator[Any], depth: int) -> Any:
        before = self._nodes
        self._count(event, 1)
        if depth > DEEPEST:
            _refuse(event, f"settings lie more than {DEEPEST} deep; give a fleet file")
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event)
        if event.tag is not None:
            _refuse(event, f"the tag {_short(event.tag)} is not YAML of a fleet file; leave it out")
        if isinstance(event, yaml.ScalarEvent):
            value = self._scalar(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self._sequence(events, depth)
        else:
            value = self._mapping(events, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = value, self._nodes - before
        return value

    def _count(self, event: Any, nodes: int) -> None:
        self._nodes += nodes
        if self._nodes > MOST_NODES:
            _refuse(event, f"the file holds more than {MOST_NODES} values, aliases counted in full; give a fleet file")

    def _alias(self, event: Any) -> Any:
        if event.anchor not in self._anchors:
            _refuse(event, f"no anchor {_short(event.anchor)} is complete before this alias; write the value out")
        value, nodes = self._anchors[event.anchor]
        self._count(event, nodes)
        return value

    def _sequence(self, events: Iterator[Any], depth: int) -> list[Any]:
        values = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            values.append(self._value(event, events, depth + 1))
        return values

    def _mapping(self, events: Iterator[Any], depth: int) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            key = self._value(event, events, depth + 1)
            if not isinstance(key, str):
                _refuse(event, f"the key {_short(key)} is no text; write it in quotes, or correct it")
            if key in values:
                _refuse(event, f"key {_short(key)} is given twice; keep one")
            values[key] = self._value(next(events), events, depth + 1)
        return values

    def _scalar(self, event: Any) -> Any:
        text: str = event.value
        if len(text) > LONGEST_TEXT:
            _refuse(event, f"a text of {len(text)} characters; settings have at most {LONGEST_TEXT}")
        if not text.isprintable():
            _refuse(event, f"{_short(text)} holds a character that cannot be seen; take it out")
        return text if event.style else self._plain(event, text)

    def _plain(self, event: Any, text: str) -> Any:
        """What a word without quotes means, if all programs agree."""
        if text in _WORDS:
            return _WORDS[text]
        if _WHOLE.fullmatch(text) or _REAL.fullmatch(text):
            if len(text) > LONGEST_NUMBER:
                _refuse(event, f"the number {_short(text)} has {len(text)} characters; round it")
            number = int(text) if _WHOLE.fullmatch(text) else float(text)
            if math.isinf(number):
                _refuse(event, f"the number {text} is too large; correct it")
            return number
        if _NO_NUMBER.fullmatch(text):
            return float(text.replace(".", ""))
        older = self._loader.resolve(yaml.ScalarNode, text, (True, False))
        if older != _TEXT_TAG or _CORE_NUMBER.fullmatch(text):
            _refuse(event, f"programs disagree about what {text} means; {_remedy(text)}")
        return text


def _remedy(text: str) -> str:
    """What to write instead of a word that is read in several ways."""
    if text == "<<":
        return "merge keys are not YAML 1.2: write the settings out"
    if text.lower() in ("yes", "no", "on", "off"):
        return f'write true or false, or "{text}" in quotes if it is a text'
    return f'write a plain decimal number, or "{text}" in quotes if it is a text'


def _refuse(event: Any, text: str) -> NoReturn:
    raise FleetFileError(f"line {event.start_mark.line + 1}: {text}")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _one_line(error: yaml.YAMLError) -> str:
    """What the parser says, with the line it says it of."""
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    if mark is None or not problem:
        return _short_text(" ".join(str(error).split()))
    return _short_text(f"line {mark.line + 1}: {problem}")


def _short_text(text: str) -> str:
    shown = "".join(letter if letter.isprintable() else "?" for letter in text)
    return shown if len(shown) <= 300 else f"{shown[:297]}..."
