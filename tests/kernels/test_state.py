"""A state and its generator go into a file and come back, bit for bit."""

import os
import subprocess
import sys
import types
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from tbdcore import state


class Cloud(NamedTuple):
    S: np.ndarray
    memory: tuple


@dataclass(frozen=True)
class Known:
    level: float = 1.0
    grid: tuple = (2, 3)


HERE = types.SimpleNamespace(Cloud=Cloud, Known=Known)


def example(rng):
    S = rng.standard_normal((4, 3)).T  # of columns, as a cloud may be
    past = (np.zeros((0, 2), np.int64), [np.float32(0.1), None, "word", True, 2**80])
    return {"cloud": Cloud(S, past), "known": Known(float("nan"), (5, -0.0)), "k": 7}


def bits(value):
    """A value as text in which no bit is lost."""
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
    if isinstance(value, dict):
        return str({key: bits(v) for key, v in value.items()})
    if isinstance(value, tuple | list):
        return f"{type(value).__name__}{[bits(v) for v in value]}"
    return repr(value)


@pytest.mark.parametrize("kind", state.BIT_GENERATORS)
def test_what_was_saved_comes_back(kind, tmp_path):
    rng = np.random.Generator(getattr(np.random, kind)(3))
    rng.integers(9, dtype=np.int32)  # half of a word is kept for the next call
    before = example(rng)
    state.save(tmp_path / "a.npz", before, rng)
    after, again = state.load(tmp_path / "a.npz", HERE)
    assert bits(after) == bits(before)
    for draw in ("random", "standard_normal", "standard_exponential"):
        assert (getattr(again, draw)(50) == getattr(rng, draw)(50)).all()
    assert (
        again.integers(9, size=7, dtype=np.int32) == rng.integers(9, size=7, dtype=np.int32)
    ).all()


def test_a_fresh_process_goes_on(tmp_path):
    rng = np.random.default_rng(5)
    state.save(tmp_path / "a.npz", (np.arange(3.0), None), rng)
    code = (
        "from tbdcore import state; s, g = state.load('a.npz'); print(s[1], g.random() + s[0][2])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout == f"None {rng.random() + 2.0}\n"


@pytest.mark.parametrize("content", [b"", b"no archive", "half", "other", "array"], ids=str)
def test_another_file_is_refused(content, tmp_path):
    file = tmp_path / "a.npz"
    state.save(file, np.arange(1000.0))
    whole = file.read_bytes()
    if content == "other":
        np.savez(file, a0=np.zeros(3))
    elif content == "array":
        with file.open("wb") as opened:
            np.save(opened, np.zeros(3))
    else:
        file.write_bytes(whole[: len(whole) // 2] if content == "half" else content)
    with pytest.raises(ValueError, match="no state saved by tbdcore") as refused:
        state.load(file)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "bad", [np.array([None]), np.ma.array([1.0], mask=[True]), print, {1: 2}, {1, 2}], ids=str
)
def test_what_cannot_be_saved_leaves_the_old_file(bad, tmp_path):
    state.save(tmp_path / "a.npz", 1)
    with pytest.raises(ValueError, match=r"state\.state\.x"):
        state.save(tmp_path / "a.npz", {"x": bad})
    assert os.listdir(tmp_path) == ["a.npz"]
    assert state.load(tmp_path / "a.npz") == (1, None)


def test_a_disk_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    state.save(tmp_path / "a.npz", 1)

    def full(file):
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="no space"):
        state.save(tmp_path / "a.npz", 2)
    assert os.listdir(tmp_path) == ["a.npz"]
    assert state.load(tmp_path / "a.npz")[0] == 1


def test_a_type_that_is_not_named_is_refused(tmp_path):
    state.save(tmp_path / "a.npz", Known())
    with pytest.raises(ValueError, match="Known is not known"):
        state.load(tmp_path / "a.npz")
