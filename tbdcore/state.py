"""Save the state of a filter and its generator, and go on in another process, bit for bit.

    state.save("track.npz", cloud, rng)
    cloud, rng = state.load("track.npz", page)

The file is an .npz without pickle: arrays, and their structure as JSON.  A state is made of
NamedTuples, frozen dataclasses, tuples, lists, dicts with words as keys, arrays of numbers,
numbers, words, None and generators.
"""

import dataclasses
import json
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

FORMAT = "tbdcore state 1"
BIT_GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")


def save(file: str | os.PathLike, state: Any, rng: np.random.Generator | None = None) -> None:
    """Write a state, and the generator that goes with it, into one .npz file, all or nothing."""
    if not isinstance(file, str | os.PathLike):
        raise ValueError(f"state.save: file: {type(file).__name__}; give the name of a file")
    arrays: list = []
    file = Path(file)
    tree = _packed({"state": state, "rng": rng}, "state", arrays)
    head = np.array(json.dumps({"format": FORMAT, "tree": tree}))
    with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        try:
            np.savez(part, head=head, **{f"a{n}": a for n, a in enumerate(arrays)})
            part.flush()
            os.fsync(part.fileno())
        except BaseException:
            os.unlink(part.name)
            raise
    os.replace(part.name, file)


def load(file: str | os.PathLike, *modules: Any) -> tuple[Any, np.random.Generator | None]:
    """The (state, generator) of a file; the generator is None if none was saved.

    modules : where the types of the state are defined, as ``tbdcore.page("mda_tbd")``
    """
    if not isinstance(file, str | os.PathLike):
        raise ValueError(f"state.load: file: {type(file).__name__}; give the name of a file")
    try:
        with open(file, "rb") as opened, np.load(opened, allow_pickle=False) as stored:
            head = json.loads(str(stored["head"]))
            arrays = [stored[f"a{n}"] for n in range(len(stored.files) - 1)]
        if head["format"] != FORMAT:
            raise KeyError
    except (ValueError, KeyError, TypeError, EOFError, AttributeError, zipfile.BadZipFile):
        words = "no state saved by tbdcore; give a file that save wrote"
        raise ValueError(f"{file}: {words}") from None
    types = {name: value for m in modules for name, value in vars(m).items()}
    both = _unpacked(head["tree"], arrays, types)
    return both["state"], both["rng"]


def _packed(value, where, arrays):
    """The value as JSON; its arrays are appended to a list and named by their number."""
    if value is None or type(value) in (bool, int, float, str):
        return {"value": value}
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind not in "biufcUSmM" or isinstance(value, np.ma.MaskedArray):
            raise ValueError(f"{where}: an array of type {value.dtype} cannot be saved")
        arrays.append(np.asarray(value))
        return {"array": len(arrays) - 1, "scalar": isinstance(value, np.generic)}
    if isinstance(value, np.random.Generator):
        return {"rng": _packed(value.bit_generator.state, where, arrays)}
    kind, parts = _parts(value, where)
    named = {"type": type(value).__qualname__} if kind == "record" else {}
    return named | {kind: {str(n): _packed(v, f"{where}.{n}", arrays) for n, v in parts.items()}}


def _parts(value, where):
    """What a container is, and its parts by name."""
    if hasattr(value, "_asdict"):
        return "record", value._asdict()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [f.name for f in dataclasses.fields(value) if f.init]
        return "record", {name: getattr(value, name) for name in fields}
    if type(value) in (tuple, list):
        return type(value).__name__, dict(enumerate(value))
    if type(value) is dict and all(type(key) is str for key in value):
        return "dict", value
    raise ValueError(f"{where}: a {type(value).__name__} cannot be saved; see help(state)")


def _unpacked(tree, arrays, types):
    """What :func:`_packed` was given."""
    if "value" in tree:
        return tree["value"]
    if "array" in tree:
        array = arrays[tree["array"]]
        return array[()] if tree["scalar"] else array
    if "rng" in tree:
        return _generator(_unpacked(tree["rng"], arrays, types))
    if "record" in tree:
        if tree["type"] not in types:
            raise ValueError(f"state: type {tree['type']} is not known; load(file, page) names it")
        parts = {name: _unpacked(v, arrays, types) for name, v in tree["record"].items()}
        return types[tree["type"]](**parts)
    (kind,) = tree
    parts = {name: _unpacked(v, arrays, types) for name, v in tree[kind].items()}
    return parts if kind == "dict" else {"tuple": tuple, "list": list}[kind](parts.values())


def _generator(state):
    """A generator that goes on from the state of its bit generator."""
    if state["bit_generator"] not in BIT_GENERATORS:
        raise ValueError(f"state: bit generator {state['bit_generator']} is unknown")
    bits = getattr(np.random, state["bit_generator"])(0)
    bits.state = state
    return np.random.Generator(bits)
