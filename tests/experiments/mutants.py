"""Files that were right and are changed somewhere: what a text editor, a power cut or ill will makes of them."""

import copy
import json
import math

import numpy as np

ODD = [
    None, True, False, 0, -1, 1, 2, 1e308, -1e308, 1e-320, math.nan, math.inf, 10**30, 2**63, "", "x", "x" * 5000,
    "\x1b[31m\x07", "[/red]", "<script>", "$\\frac{", "../../../x", "\u202e", "\ud800", "1e5", [], {}, [[]], [1, "a"],
    {"a": 1}, [0] * 400, [[[]]] * 40, "\x00", 3.7, "NaN",
]  # fmt: skip


def places(content, path=()):
    """Paths to every value."""
    yield path
    if isinstance(content, dict):
        for key, value in content.items():
            yield from places(value, (*path, key))
    elif isinstance(content, list):
        for number, value in enumerate(content[:40]):
            yield from places(value, (*path, number))


def changed(content, random):
    """A copy with one to three values replaced, removed, doubled or moved."""
    content = copy.deepcopy(content)
    for _ in range(random.integers(1, 4)):
        found = [path for path in places(content) if path]
        if not found:
            break
        *above, last = found[random.integers(len(found))]
        inside = content
        for key in above:
            inside = inside[key]
        what = random.integers(6)
        if what <= 2:
            inside[last] = copy.deepcopy(ODD[random.integers(len(ODD))])
        elif what == 3:
            del inside[last]
        elif what == 4:
            inside[last] = [inside[last]] * int(random.integers(0, 4))
        elif isinstance(inside, list):
            inside.append(inside[last])
        else:
            inside[f"{last}x"] = inside.pop(last)
    return content


def torn(data, random):
    """Bytes cut off, filled with zeros, changed or put twice."""
    data = bytearray(data)
    at = int(random.integers(len(data)))
    what = random.integers(5)
    if what == 0:
        return bytes(data[:at])
    if what == 1:
        data[at : at + 512] = bytes(len(data[at : at + 512]))
    elif what == 2:
        for _ in range(8):
            data[int(random.integers(len(data)))] = int(random.integers(256))
    elif what == 3:
        data[at:at] = data[at : at + 200]
    else:
        data[at : at + 1] = bytes([int(random.integers(256))])
    return bytes(data)


def as_json(content, random):
    """Text of changed content, now and then torn, or nested without end."""
    what = random.integers(8)
    if what == 0:
        return torn(json.dumps(content).encode(), random)
    if what == 1 and random.integers(20) == 0:
        return b"[" * 50_000
    return json.dumps(changed(content, random)).encode()


def other_array(array, random):
    """The array with another shape, type or contents."""
    what = random.integers(9)
    if what == 0:
        return array[..., :0] if array.ndim else array
    if what == 1:
        return array[: len(array) // 2] if array.ndim else array
    if what == 2:
        return np.asarray(array, dtype=str) if array.size < 10_000 else array
    if what == 3 and array.dtype.kind == "f":
        other = array.copy()
        other[tuple(random.integers(s) for s in array.shape)] = [math.nan, math.inf, 1e300, -1e9][random.integers(4)]
        return other
    if what == 4:
        return array.astype(complex) if array.dtype.kind in "fib" else array
    if what == 5:
        return array[None]
    if what == 6:
        return np.zeros(array.shape, dtype=[("a", float)])
    if what == 7 and array.dtype.kind in "iu" and array.size:
        return np.full(array.shape, 250, dtype=array.dtype)
    return np.zeros(0)


def other_arrays(arrays, random):
    """Arrays of a file with one changed, missing or added, or with other settings."""
    arrays = dict(arrays)
    what = random.integers(4)
    if what <= 1:
        arrays["meta"] = np.array(json.dumps(changed(json.loads(str(arrays["meta"])), random)))
        return arrays
    name = list(arrays)[random.integers(len(arrays))]
    if what == 2 and random.integers(4) == 0:
        del arrays[name]
    else:
        arrays[name] = other_array(arrays[name], random)
    return arrays
