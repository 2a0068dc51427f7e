"""The recursions over cells against all paths of a small grid, in plain loops."""

import itertools
import math

import numpy as np
import pytest

from tbdcore import baseline

K, SHAPE = 4, (3, 2)
CELLS = list(np.ndindex(*SHAPE))
WALK = np.array([[0.05, 0.1, 0.05], [0.1, 0.4, 0.1], [0.05, 0.1, 0.05]])
LOPSIDED = np.array([[0.0, 0.0, 0.3], [0.2, 0.1, 0.0], [0.0, 0.4, 0.0]])
STAY, BIRTH = 0.9, 0.05


def log_ratios(seed=1):
    return np.random.default_rng(seed).normal(scale=1.5, size=(K, *SHAPE))


def step(walk, before, after):
    """Probability of the step between two states; None is no target."""
    if before is None:
        return 1 - BIRTH if after is None else BIRTH / len(CELLS)
    moves = {
        cell: STAY * walk[cell[0] - before[0] + 1, cell[1] - before[1] + 1]
        for cell in CELLS
        if max(abs(cell[0] - before[0]), abs(cell[1] - before[1])) <= 1
    }
    return 1 - sum(moves.values()) if after is None else moves.get(after, 0.0)


def by_all_paths(walk, z):
    """W of the last frame: the share of each last state in the weight of all sequences."""
    total = dict.fromkeys([None, *CELLS], 0.0)
    for states in itertools.product([None, *CELLS], repeat=len(z)):
        weight, before = 1.0, None
        for frame, state in zip(z, states, strict=True):
            weight *= step(walk, before, state)
            weight *= 1.0 if state is None or np.isnan(frame[state]) else math.exp(frame[state])
            before = state
        total[states[-1]] += weight
    return np.array([total[cell] for cell in CELLS]).reshape(SHAPE) / sum(total.values())


@pytest.mark.parametrize("walk", [WALK, LOPSIDED], ids=["even", "lopsided"])
@pytest.mark.parametrize("gap", [False, True])
def test_grid_filter_is_the_sum_over_all_paths(walk, gap):
    z = log_ratios()
    if gap:
        z[1, 0] = np.nan
    W = baseline.grid_filter(z, walk, STAY, BIRTH)
    for k in range(K):
        np.testing.assert_allclose(W[k], by_all_paths(walk, z[: k + 1]), rtol=1e-12)


def test_grid_filter_without_evidence_is_the_prior():
    W = baseline.grid_filter(np.zeros((300, 9, 9)), np.ones((1, 1)), STAY, BIRTH)
    existence = BIRTH / (BIRTH + 1 - STAY)
    np.testing.assert_allclose(W[-1], existence / 81, rtol=1e-9)


def test_grid_filter_survives_ratios_that_overflow():
    z = np.zeros((2, 3, 3))
    z[:, 1, 1] = 1e6
    W = baseline.grid_filter(z, np.ones((1, 1)), STAY, BIRTH)
    assert W[-1, 1, 1] == pytest.approx(1.0)


def best_tail(z, cell, walk, memory):
    """The best of all paths to a cell of the last frame, of any length, by recursion over paths."""
    before = [
        best_tail(z[:-1], other, walk, memory)
        for other in CELLS
        if len(z) > 1 and max(abs(other[0] - cell[0]), abs(other[1] - cell[1])) <= walk
    ]
    return np.nan_to_num(z[-1][cell]) + memory * max([0.0, *before])


@pytest.mark.parametrize(("walk", "memory"), [(0, 1.0), (1, 0.9), (2, 0.5)])
def test_recursive_maximum_is_the_best_of_all_paths(walk, memory):
    z = log_ratios(2)
    z[2, 1] = np.nan
    V = baseline.recursive_maximum(z, walk, memory)
    for k in range(K):
        best = [best_tail(z[: k + 1], cell, walk, memory) for cell in CELLS]
        np.testing.assert_allclose(V[k], np.reshape(best, SHAPE), rtol=1e-12)


def test_without_motion_and_fading_it_is_pages_test():
    z = np.random.default_rng(3).normal(size=(50, 1, 1))
    total, values = 0.0, []
    for x in z.ravel():
        total = max(0.0, total) + x
        values.append(total)
    np.testing.assert_allclose(baseline.recursive_maximum(z, 0, 1.0).ravel(), values, rtol=1e-12)


@pytest.mark.parametrize(
    ("walk", "stay", "birth", "words"),
    [
        (np.ones((2, 2)) / 4, 0.9, 0.1, "walk"),
        (np.ones((3, 3)), 0.9, 0.1, "walk"),
        (WALK, 1.1, 0.1, "stay"),
        (WALK, 0.9, -0.1, "birth"),
    ],
)
def test_nonsense_is_refused_in_one_line(walk, stay, birth, words):
    with pytest.raises(ValueError, match=rf"grid_filter.*{words}") as caught:
        baseline.grid_filter(log_ratios(), walk, stay, birth)
    assert "\n" not in str(caught.value)
