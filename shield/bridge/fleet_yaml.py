"""The text of a FLEET.yaml as plain settings: YAML 1.2's core schema, and of that only what all programs read alike.

YAML 1.1 and 1.2 disagree about what a plain word means: ``010`` is 8 or 10, ``5:30`` is 330 or a text, ``yes`` is true
or a text. Such words are refused with the remedy; so are tags, merge keys and whatever is too large to be a fleet file.
"""

from __future__ import annotations

import math
import re
from typing import Any, NoReturn

import yaml

from ..exceptions import FleetFileError

MOST_BYTES = 128 << 10  # largest text, bytes: 64 boats with all their settings take a tenth
DEEPEST, MOST_NODES = 12, 20_000  # settings lie at most so deep; values, each alias counted as all that it stands for
LONGEST_TEXT, LONGEST_NUMBER = 1000, 32  # characters of one value; digits and signs of a number
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
    if end := _LINE_ENDS.search(text):
        line, code = text.count("\n", 0, end.start()) + 1, ord(end[0])
        raise FleetFileError(f"line {line}: programs disagree about whether U+{code:04X} ends a line; use newlines")
    try:
        return _Reader(text).document()
    except yaml.YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        said = f"line {mark.line + 1}: {problem}" if mark and problem else " ".join(str(error).split())
        said += "; indent by spaces, not by tabs" if r"'\t'" in said else ""
        said = "".join(letter if letter.isprintable() else "?" for letter in said)
        raise FleetFileError(short(said, 300)) from None


def short(text: str, most: int = 60) -> str:
    """A text for a line that a person reads."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


class _Reader:
    """Makes values of the parser's events, so that what is too large is never built."""

    def __init__(self, text: str) -> None:
        self._loader = yaml.SafeLoader(text)  # the one in Python: it reads the same on every machine
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._nodes = 0

    def document(self) -> Any:
        """The only document's value; None for an empty text."""
        self._next()  # the stream's start
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        value = self._value(self._next(), 1)
        self._next()  # the document's end
        if not isinstance(extra := self._next(), yaml.StreamEndEvent):
            _refuse(extra, "a second document begins; give one")
        return value

    def _next(self) -> Any:
        return self._loader.get_event()

    def _value(self, event: Any, depth: int) -> Any:
        before, self._nodes = self._nodes, self._nodes + 1
        value: Any
        if depth > DEEPEST:
            _refuse(event, f"settings lie more than {DEEPEST} deep; give a fleet file")
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                _refuse(event, f"no anchor {event.anchor!r} is complete before this alias; write the value out")
            value, nodes = self._anchors[event.anchor]
            self._nodes += nodes
        elif event.tag is not None:
            _refuse(event, f"the tag {short(repr(event.tag))} is not YAML of a fleet file; leave it out")
        elif isinstance(event, yaml.ScalarEvent):
            value = self._scalar(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = []
            while not isinstance(item := self._next(), yaml.SequenceEndEvent):
                value.append(self._value(item, depth + 1))
        else:
            value = self._mapping(depth)
        if self._nodes > MOST_NODES:
            _refuse(event, f"the file holds more than {MOST_NODES} values, aliases counted in full; give a fleet file")
        if event.anchor is not None and not isinstance(event, yaml.AliasEvent):
            self._anchors[event.anchor] = value, self._nodes - before
        return value

    def _mapping(self, depth: int) -> dict[str, Any]:
        values: dict[str, Any] = {}
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            key = self._value(event, depth + 1)
            if not isinstance(key, str):
                _refuse(event, f"the key {short(repr(key))} is no text; write it in quotes, or correct it")
            if key in values:
                _refuse(event, f"key {short(repr(key))} is given twice; keep one")
            values[key] = self._value(self._next(), depth + 1)
        return values

    def _scalar(self, event: Any) -> Any:
        text: str = event.value
        if len(text) > LONGEST_TEXT:
            _refuse(event, f"a text of {len(text)} characters; settings have at most {LONGEST_TEXT}")
        if not text.isprintable():
            _refuse(event, f"{short(repr(text))} holds a character that cannot be seen; take it out")
        return text if event.style else self._plain(event, text)

    def _plain(self, event: Any, text: str) -> Any:
        """What a word without quotes means, if all programs agree."""
        if text in _WORDS:
            return _WORDS[text]
        if _REAL.fullmatch(text):
            if len(text) > LONGEST_NUMBER:
                _refuse(event, f"the number {short(repr(text))} has {len(text)} characters; round it")
            number = int(text) if _WHOLE.fullmatch(text) else float(text)
            if math.isinf(number):
                _refuse(event, f"the number {text} is too large; correct it")
            return number
        if _NO_NUMBER.fullmatch(text):
            return float(text.replace(".", ""))
        older = self._loader.resolve(yaml.ScalarNode, text, (True, False))
        if older == yaml.SafeLoader.DEFAULT_SCALAR_TAG and not _CORE_NUMBER.fullmatch(text):
            return text
        remedy = f'write a plain decimal number, or "{text}" in quotes if it is a text'
        if text == "<<":
            remedy = "merge keys are not YAML 1.2: write the settings out"
        elif text.lower() in ("yes", "no", "on", "off"):
            remedy = f'write true or false, or "{text}" in quotes if it is a text'
        _refuse(event, f"programs disagree about what {text} means; {remedy}")


def _refuse(event: Any, text: str) -> NoReturn:
    raise FleetFileError(f"line {event.start_mark.line + 1}: {text}")
