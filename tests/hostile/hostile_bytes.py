"""Damage to bytes, texts, numbers and zip files, drawn from a generator of numpy's."""

import contextlib
import io
import json
import zipfile

import numpy as np

NUMBERS = (
    0,
    1,
    -1,
    2,
    3,
    5,
    7,
    127,
    255,
    65_535,
    2**31 - 1,
    2**31,
    2**32,
    2**63 - 1,
    2**63,
    10**19,
    10**30,
    -(2**31),
    -(2**63),
    0.5,
    -0.0,
    1e-300,
    1e38,
    1e300,
    1e400,
    -1e400,
    float("nan"),
)
TEXTS = (
    "",
    " ",
    ".",
    "..",
    "/",
    "../secret",
    "../../etc/passwd",
    "/etc/passwd",
    "/dev/zero",
    "C:\\x",
    "a\\b",
    "a/../b",
    "./template.npy",
    "x" * 300,
    "x" * 70_000,
    "\0",
    "a\0b",
    "\n",
    "a\nb",
    "\u202e",
    "\ud800",
    "é",
    "長" * 90,
    "😀",
    "%s%n",
    "{}",
    "null",
    "NaN",
    "-",
    "--help",
    "con",
    "~",
    "$HOME",
    "file:///etc/passwd",
    "template.npy",
    "manifest.json",
    "decoder_step.onnx",
    ".",
    "a:1",
    "1e999",
)


def pick(rng, values):
    return values[int(rng.integers(len(values)))]


def odd_value(rng):
    """Something that JSON or YAML can say and nobody expects."""
    made = (
        lambda: pick(rng, NUMBERS),
        lambda: pick(rng, NUMBERS),
        lambda: pick(rng, TEXTS),
        lambda: pick(rng, TEXTS),
        lambda: pick(rng, (None, True, False, [], {}, [[]], [None], {"": None})),
        lambda: [pick(rng, NUMBERS) for _ in range(int(rng.integers(1, 5)))],
        lambda: nested(int(rng.integers(2, 40))),
    )
    return pick(rng, made)()


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


def damaged(rng, data):
    """Bytes with one to four wounds, most of them in the header."""
    data = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        data = _wound(rng, data)
    return bytes(data)


def _wound(rng, data):
    if not data:
        return bytearray(rng.bytes(int(rng.integers(0, 64))))
    at = int(rng.integers(min(len(data), 128 if rng.random() < 0.7 else len(data))))
    n = int(pick(rng, (1, 1, 2, 4, 8, 64, 1024)))
    kind = int(rng.integers(8))
    if kind == 0:
        data[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        size = pick(rng, (1, 2, 4, 8))
        value = pick(rng, [x for x in NUMBERS if isinstance(x, int)]) % (1 << 8 * size)
        data[at : at + size] = value.to_bytes(size, pick(rng, ("little", "big")))
    elif kind == 2:
        data[at : at + n] = rng.bytes(len(data[at : at + n]))
    elif kind == 3:
        del data[at:]
    elif kind == 4:
        del data[at : at + n]
    elif kind == 5:
        data[at:at] = rng.bytes(n)
    elif kind == 6:
        data[at:at] = data[at : at + n]
    else:
        data[at : at + n] = pick(rng, (b"\0", b"\xff", b" ", b"9")) * len(data[at : at + n])
    return data


def damaged_text(rng, text):
    """A text with its structure broken, as UTF-8 or in another encoding."""
    kind = int(rng.integers(7))
    if kind == 0:
        return text.encode(pick(rng, ("utf-16", "utf-8-sig", "utf-32")))
    if kind == 1:
        deep = int(pick(rng, (100, 1000, 100_000)))
        return (pick(rng, ("[", '{"a":', "- ", "(")) * deep).encode()
    if kind == 2:
        at = int(rng.integers(len(text)))
        return (
            text[:at] + pick(rng, ("1" * 5000, "1e999", "NaN", "\0", "}", "]")) + text[at:]
        ).encode()
    return damaged(rng, text.encode())


def paths_of(tree, path=()):
    """Every place within lists and dictionaries."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, (dict, list)):
            yield from paths_of(value, (*path, key))


def change_tree(rng, tree):
    """Replace, remove, double or exchange something anywhere in a JSON or YAML tree."""
    places = list(paths_of(tree))
    place = pick(rng, places)
    parent = tree
    for key in place[:-1]:
        parent = parent[key]
    key, kind = place[-1], int(rng.integers(10))
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[pick(rng, TEXTS)] = odd_value(rng)
    elif kind == 1:
        parent.append(parent[key])
    elif kind in (2, 3):
        other = tree
        for step in pick(rng, places):
            if not isinstance(other, (dict, list)):
                break
            try:
                other = other[step]
            except (KeyError, IndexError):
                break
        parent[key] = json.loads(json.dumps(other))
    elif kind == 4 and isinstance(parent[key], (int, float)):
        parent[key] = parent[key] * pick(rng, (-1, 0, 2, 1000)) + pick(rng, (-1, 0, 1))
    else:
        parent[key] = odd_value(rng)


ARRAYS = (
    lambda rng, a: a.astype(
        pick(rng, ("f2", "f4", "f8", ">f4", "i4", "u1", "U3", "?", "c8", "S2"))
    ),
    lambda rng, a: a.ravel(),
    lambda rng, a: a[:-1],
    lambda rng, a: np.concatenate([a, a]),
    lambda rng, a: a[..., None],
    lambda rng, a: np.asfortranarray(a),
    lambda rng, a: a * np.array(pick(rng, (0, -1, 1e30, 255)), a.dtype),
    lambda rng, a: a[:0],
    lambda rng, a: np.zeros((), a.dtype),
    lambda rng, a: np.array([("x", 1)], [("a", "U1"), ("b", "i4")]),
    lambda rng, a: np.where(
        rng.random(a.shape) < 0.01, np.array(pick(rng, (2**31 - 1, -1)), a.dtype), a
    ),
)


def change_array(rng, array):
    """Bytes of an .npy file: another array, other values, or a header that lies."""
    if array.dtype.kind == "f" and rng.random() < 0.25:
        array = array.copy()
        array.flat[int(rng.integers(max(array.size, 1))) :: 7] = pick(rng, (np.nan, np.inf, 1e38))
    elif rng.random() < 0.6:
        failures = (ValueError, TypeError, OverflowError, IndexError)
        with np.errstate(all="ignore"), contextlib.suppress(*failures):
            array = pick(rng, ARRAYS)(rng, array)
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    data = buffer.getvalue()
    if rng.random() < 0.5:
        return data
    if rng.random() < 0.4:
        return damaged(rng, data)
    order = pick(rng, ("False", "True", "1"))
    head = f"{{'descr': {pick(rng, DESCRIPTIONS)}, 'fortran_order': {order}, "
    head += f"'shape': {pick(rng, SHAPES)}, }}"
    end = data[128:]
    return b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head.encode() + end


DESCRIPTIONS = (
    "'<f4'",
    "'<f8'",
    "'<i4'",
    "'|O'",
    "'|V8'",
    "'<U1000000000'",
    "'zz'",
    "[('a', '<f4')]",
    "1",
)
SHAPES = (
    "()",
    "(1,)",
    "(42, 3)",
    "(-1, 3)",
    "(2**40,)",
    "(1099511627776, 1099511627776)",
    "(0, 0)",
    "(True,)",
    "(42.0, 3)",
    "42",
    "(99999999999999999999999,)",
    "(" * 300,
)


def change_zip(rng, arrays):
    """An .npz file of arrays: one of them changed, or the archive itself."""
    buffer = io.BytesIO()
    which = pick(rng, sorted(arrays))
    compression = pick(
        rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, array in arrays.items():
            if name == which and rng.random() < 0.2:
                continue
            if name == which and rng.random() < 0.7:
                archive.writestr(f"{name}.npy", change_array(rng, array))
                continue
            plain = io.BytesIO()
            np.save(plain, array)
            archive.writestr(f"{name}.npy", plain.getvalue())
        if rng.random() < 0.1:
            archive.writestr("zeros.npy", bytes(1 << 27))
        if rng.random() < 0.1:
            archive.writestr(pick(rng, ("../x.npy", "/x", "names", "codes")), b"x")
    data = buffer.getvalue()
    if rng.random() < 0.1:  # member names of bytes that are no UTF-8, flags of encryption
        return data.replace(b"PK\1\2", b"PK\1\2\x09\x09\x09\x09", 1)
    return damaged(rng, data) if rng.random() < 0.4 else data
