"""Dynamic programming against the enumeration of all paths, against SciPy, against closed forms,
and under symmetries.
"""

import itertools

import numpy as np
import pytest
from scipy import ndimage

from tbdcore import checks
from tbdcore.kernels import dp_tbd

ONE = np.ones(1)
A = 0.95
EQUAL = np.array([A, 1.0, A])
LITERAL = np.array([[A ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])


def transition(name, M):
    """A set of the paper, in a margin of M + 1."""
    v, width = (1 - M, M), M + 1
    price = np.array([0.4, 0.0, 0.4])
    return {
        "conventional": lambda: dp_tbd.box_transition(np.ones(2 * M + 1), (0, 0), width),
        "tonissen": lambda: dp_tbd.box_transition(np.array([0.0, 1.0, 1.0]), v, width),
        "weighted": lambda: dp_tbd.weighted_transition(EQUAL, EQUAL, v, width),
        "unweighted": lambda: dp_tbd.weighted_transition(np.ones(3), np.ones(3), v, width),
        "literal": lambda: dp_tbd.coupled_transition(LITERAL, v, width),
        "penalised": lambda: dp_tbd.penalised_transition(price, price, v, width),
    }[name]()


def solve(z, name, M):
    """Value maps without their margin (K, V, V, Nx, Ny), and the best path of states, cells counted
    from 0.
    """
    way = transition(name, M)
    I = dp_tbd.forward(dp_tbd.margin(z, M + 1), way)
    path = dp_tbd.path(I, np.unravel_index(I[-1].argmax(), I[-1].shape), way)
    inside = slice(M + 1, -M - 1)
    return I[..., inside, inside], path - [0, 0, M + 1, M + 1]


NAMES = ("conventional", "tonissen", "weighted", "literal", "unweighted", "penalised")


# The oracle: eqs. (6) to (12) as they are printed, state by state, path by path
# ----------------------------------------------


def predecessors(name, x, M, shape):
    """Pairs (predecessor, deviations) of eqs. (6), (7), (8); the deviations are those of eqs. (9)
    and (10).
    """
    i, j, iv, jv = x
    if name == "conventional":
        every = (((i + m, j + n, 0, 0), (0, 0)) for m in range(-M, M + 1) for n in range(-M, M + 1))
    elif name == "tonissen":
        every = (((i + m - iv, j + n - jv, iv, jv), (0, 0)) for m in (0, 1) for n in (0, 1))
    else:
        slack = itertools.product((-1, 0, 1), repeat=4)
        every = (
            ((i + m - iv - r, j + n - jv - s, iv + r, jv + s), ((m, n), (r, s)))
            if name != "literal"
            else ((i + m - iv - r, j + n - jv - s, iv + r, jv + s), ((m - r, n - s), (r, s)))
            for m, n, r, s in slack
        )
    speeds = (0,) if name == "conventional" else range(-M + 1, M + 1)
    for y, deviation in every:
        if 0 <= y[0] < shape[0] and 0 <= y[1] < shape[1] and y[2] in speeds and y[3] in speeds:
            yield y, int(np.abs(deviation).sum())


def step(name, value, deviation):
    """What a transition makes of the accumulated value."""
    if name == "penalised":
        return value - 0.4 * deviation
    return value * A**deviation if name in ("weighted", "literal") else value


def paths(name, x, k, z, M):
    """All (value, path) that end in state x of frame k."""
    here = z[k][x[0], x[1]]
    if k == 0:
        yield here, (x,)
        return
    for y, deviation in predecessors(name, x, M, z.shape[1:]):
        for value, path in paths(name, y, k - 1, z, M):
            yield here + step(name, value, deviation), (*path, x)


SIZES = {
    "conventional": (2, (4, 5), 4),
    "tonissen": (2, (4, 5), 4),
}  # M, grid, frames; the others have 81 predecessors


@pytest.mark.parametrize("shift", [0.0, -6.0], ids=["mixed signs", "all negative"])
@pytest.mark.parametrize("name", NAMES)
def test_values_and_path_equal_the_enumeration_of_all_paths(name, shift):
    M, shape, K = SIZES.get(name, (2, (3, 3), 3))
    z = np.random.default_rng(11).normal(shift, 1.0, (K, *shape))
    I, path = solve(z, name, M)
    speeds = (0,) if name == "conventional" else range(-M + 1, M + 1)
    found = {}
    for x in itertools.product(range(shape[0]), range(shape[1]), speeds, speeds):
        found[x] = max(paths(name, x, K - 1, z, M), default=(-np.inf, None))
        a, b = x[2] - speeds[0], x[3] - speeds[0]
        assert I[-1, a, b, x[0], x[1]] == pytest.approx(found[x][0], rel=1e-12)
    value, best = max(found.values())
    assert I[-1].max() == pytest.approx(value, rel=1e-12)
    assert path[:, 2:].tolist() == [list(x[:2]) for x in best]


def test_some_states_of_the_enumeration_cannot_be_reached():
    I, _ = solve(np.zeros((4, 4, 5)), "tonissen", 2)
    assert np.isneginf(I[-1]).any()


# Peers and closed forms


def test_conventional_forward_pass_is_a_maximum_filter():
    z = np.random.default_rng(2).normal(-3.0, 1.0, (2, 50, 50))
    I, _ = solve(z, "conventional", 3)
    theirs = z[1] + ndimage.maximum_filter(z[0], size=7, mode="constant", cval=-np.inf)
    np.testing.assert_array_equal(I[1, 0, 0], theirs)


@pytest.mark.parametrize("name", NAMES)
def test_one_frame_is_its_largest_cell(name):
    z = np.random.default_rng(5).normal(size=(1, 6, 7))
    _, path = solve(z, name, 3)
    assert tuple(path[0, 2:]) == np.unravel_index(z[0].argmax(), (6, 7))


def test_two_frames_decouple_when_every_cell_can_be_reached():
    z = np.random.default_rng(6).normal(size=(2, 6, 7))
    I, path = solve(np.pad(z, ((0, 0), (8, 8), (8, 8)), constant_values=-99), "conventional", 7)
    assert [tuple(x) for x in path[:, 2:] - 8] == [
        np.unravel_index(frame.argmax(), (6, 7)) for frame in z
    ]
    assert I[-1].max() == z[0].max() + z[1].max()


@pytest.mark.parametrize(("dx", "g"), [((1, 1), 1.0), ((2, 2), 1.0), ((4, 0), A)])
def test_a_noise_free_track_keeps_a_geometric_share_of_its_energy(dx, g):
    """Displacement = velocity - m: with the fastest velocity 3 a step of 4 costs one position slack
    in every frame.
    """
    K = 11
    z = np.full((K, 60, 60), -1e6)
    for k in range(K):
        z[k, 5 + dx[0] * k, 5 + dx[1] * k] = 1.0
    I, _ = solve(z, "weighted", 3)
    expected = K if g == 1 else (1 - g**K) / (1 - g)
    assert I[-1].max() == pytest.approx(expected, rel=1e-12)


def test_weighted_equals_coupled_where_the_table_is_a_product():
    z = dp_tbd.margin(np.random.default_rng(8).normal(-1.0, 1.0, (4, 12, 9)), 4)
    table = dp_tbd.coupled_transition(np.outer(EQUAL, EQUAL), (-2, 3), 4)
    ours = dp_tbd.forward(z, transition("weighted", 3))
    theirs = dp_tbd.forward(z, table)
    np.testing.assert_allclose(ours, theirs, rtol=1e-13, atol=1e-14)


def test_unreachable_final_states_are_counted():
    """Per axis Tonissen reaches 240 of 300 (position, velocity) pairs in 11 frames of 50 cells; the
    extended set all but one.
    """
    z = np.zeros((11, 50, 50))
    assert np.isneginf(solve(z, "conventional", 3)[0][-1]).mean() == 0
    assert np.isneginf(solve(z, "tonissen", 3)[0][-1]).mean() == pytest.approx(
        1 - (240 / 300) ** 2, abs=1e-15
    )
    assert np.isneginf(solve(z, "weighted", 3)[0][-1]).mean() == pytest.approx(
        1 - (299 / 300) ** 2, abs=1e-15
    )


# Symmetries

DATA = np.random.default_rng(7).normal(0.5, 1.0, (6, 14, 11))


def cells(z, name):
    return solve(z, name, 3)[1][:, 2:]


@pytest.mark.parametrize("name", [name for name in NAMES if name != "penalised"])
def test_scaling_the_data_changes_no_path(name):
    np.testing.assert_array_equal(cells(4.0 * DATA, name), cells(DATA, name))


@pytest.mark.parametrize("name", ["conventional", "tonissen", "unweighted", "penalised"])
def test_shifting_the_data_changes_no_path(name):
    np.testing.assert_array_equal(cells(DATA - 8.0, name), cells(DATA, name))
    np.testing.assert_array_equal(cells(DATA + 8.0, name), cells(DATA, name))


@pytest.mark.parametrize("name", ["weighted", "literal"])
def test_a_multiplicative_weight_is_not_invariant_to_a_shift(name):
    assert (cells(DATA - 8.0, name) != cells(DATA, name)).any()


@pytest.mark.parametrize("name", NAMES)
def test_transposed_data_give_the_transposed_path(name):
    np.testing.assert_array_equal(cells(DATA.transpose(0, 2, 1), name), cells(DATA, name)[:, ::-1])


@pytest.mark.parametrize("name", ["conventional", "tonissen"])
def test_reflected_data_give_the_reflected_path(name):
    """The mirror image of velocity v is 1 - v under the slacks {0, 1}: displacement v - m becomes
    -(v - m) = (1 - v) - (1 - m).
    """
    x = cells(DATA, name)
    np.testing.assert_array_equal(
        cells(DATA[:, ::-1], name), np.stack((13 - x[:, 0], x[:, 1]), axis=1)
    )


def test_a_larger_set_never_lowers_a_value():
    extended, kept = (solve(DATA, name, 3)[0][-1] for name in ("unweighted", "tonissen"))
    assert (extended >= kept).all()
    weighted = solve(DATA + 9.0, "weighted", 3)[0][-1]
    assert (solve(DATA + 9.0, "unweighted", 3)[0][-1] >= weighted).all()
    assert not (weighted >= solve(DATA + 9.0, "tonissen", 3)[0][-1]).all()


def test_single_precision_rounds_and_does_nothing_else():
    z = dp_tbd.margin(DATA.astype(np.float32), 4)
    I = dp_tbd.forward(z, transition("weighted", 3))
    assert I.dtype == np.float32
    np.testing.assert_allclose(
        I[-1][..., 4:-4, 4:-4], solve(DATA, "weighted", 3)[0][-1], rtol=2e-6, atol=2e-6
    )


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [0, 5])
@pytest.mark.parametrize("name", ["weighted", "literal", "penalised"])
def test_the_path_reaches_both_ends_of_the_velocities(name, end, axis):
    """The only finite predecessor has the lowest or highest velocity; the state is one above it or
    below, and at the end itself.
    """
    for offset in (0, 1):
        state, before = [2, 2, 9, 9], [2, 2, 9, 9]
        before[axis], state[axis] = end, abs(end - offset)
        for a in (0, 1):
            before[2 + a] = 9 - (before[a] - 2)  # slack 0: the cell left at the former velocity
        I = np.full((2, 6, 6, 20, 20), -np.inf)
        I[0][tuple(before)] = 1.0
        path = dp_tbd.path(I, tuple(state), transition(name, 3))
        assert path[0].tolist() == before


@pytest.mark.parametrize("name", NAMES)
def test_before_a_state_without_a_predecessor_the_path_is_minus_one(name):
    I = np.full((3, 6, 6, 20, 20), -np.inf)
    state = [2, 2, 9, 9]
    I[2][tuple(state)] = 1.0
    path = dp_tbd.path(I, tuple(state), transition(name, 3))
    assert path.tolist() == [[-1] * 4, [-1] * 4, state]


# Bad input


@pytest.mark.parametrize("frames", [np.zeros((2, 0, 5)), np.full((2, 3, 4), np.nan)])
def test_bad_frames_are_one_line(frames):
    with pytest.raises(ValueError, match=r"frames[^\n]+$"):
        dp_tbd.margin(frames, 3)


CORNERS = [(0, 0, 4), (1, 16, 5), (1, 5, 0), (0, 6, 14)]
EDGES = [(1, 3, 7), (1, 13, 7)]  # the rows of the margin beside the first and last cells


@pytest.mark.parametrize("cell", [*CORNERS, *EDGES])
def test_frames_without_their_margin_are_refused(cell):
    z = dp_tbd.margin(np.zeros((2, 9, 7)), 4)
    z[cell] = 0.0
    with pytest.raises(ValueError, match="margin"):
        dp_tbd.forward(z, transition("weighted", 3))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_cell_that_is_not_a_number_is_refused(value):
    z = dp_tbd.margin(np.zeros((2, 9, 7)), 4)
    z[1, 6, 6] = value
    with pytest.raises(ValueError, match="NaN, inf"):
        dp_tbd.forward(z, transition("tonissen", 3))


BAD_BOX = {
    "an even number": (np.ones(4), (0, 0), 4),
    "slack zero left out": ([1, 0, 1], (0, 0), 4),
    "slacks that are no neighbours": ([1.0, 0, 1, 1, 1], (-1, 1), 4),
    "velocity below the margin": (np.ones(3), (-4, 0), 4),
    "velocity above the margin": (np.ones(3), (0, 4), 4),
    "no velocity": (np.ones(3), (1, 0), 4),
    "a slack above the margin": (np.ones(11), (0, 0), 4),
}


@pytest.mark.parametrize("name", BAD_BOX)
def test_a_bad_transition_is_one_line(name):
    with pytest.raises(ValueError, match=r"^box_transition: (position|width|velocities): [^\n]+$"):
        dp_tbd.box_transition(*BAD_BOX[name])


def test_a_table_with_a_zero_is_refused():
    table = LITERAL * (np.arange(9).reshape(3, 3) != 0)
    with pytest.raises(ValueError, match=r"^coupled_transition: table: [^\n]+$"):
        dp_tbd.coupled_transition(table, (-2, 3), 4)


@pytest.mark.parametrize("argument", [0, 1])
def test_a_middle_that_is_left_out_is_refused(argument):
    for make, odd in ((dp_tbd.penalised_transition, np.inf), (dp_tbd.weighted_transition, 0.0)):
        weights = [np.ones(3), np.ones(3)]
        weights[argument][1] = odd
        with pytest.raises(ValueError, match=r"_transition: (position|velocity): [^\n]+$"):
            make(*weights, (-2, 3), 4)


def test_the_limit_of_memory_counts_the_margin(monkeypatch):
    monkeypatch.setattr(checks, "LARGEST", 3 * 10 * 12)
    assert dp_tbd.margin(np.zeros((3, 6, 8)), 2).shape == (3, 10, 12)
    for shape, width in (((3, 7, 8), 2), ((3, 6, 9), 2), ((4, 6, 8), 2), ((3, 6, 8), 3)):
        with pytest.raises(ValueError, match=r"margin: width: [^\n]+ memory [^\n]+$"):
            dp_tbd.margin(np.zeros(shape), width)


def test_a_margin_as_wide_as_the_frame_is_refused():
    with pytest.raises(ValueError, match=r"^forward: z: [^\n]+$"):
        dp_tbd.forward(np.zeros((2, 8, 9)), transition("weighted", 3))


@pytest.mark.parametrize(
    "state",
    [(6, 0, 5, 5), (0, 6, 5, 5), (0, 0, 20, 5), (0, 0, 5, 20), (0, 0, 0), (0, 0, 5, 5.0)],
)
def test_a_final_state_outside_the_maps_is_refused(state):
    with pytest.raises(ValueError, match=r"^path: state: [^\n]+$"):
        dp_tbd.path(np.zeros((2, 6, 6, 20, 20)), state, transition("weighted", 3))


@pytest.mark.parametrize("cell", [(0, 0), (0, 4), (4, 0), (4, 4)])
def test_a_path_reaches_the_first_and_the_last_cell_of_a_map(cell):
    I = np.zeros((2, 1, 1, 5, 5))
    I[0, 0, 0][cell] = 1.0
    start = tuple(min(max(c, 1), 3) for c in cell)
    path = dp_tbd.path(I, (0, 0, *start), dp_tbd.box_transition(np.ones(3), (0, 0), 1))
    assert path.tolist() == [[0, 0, *cell], [0, 0, *start]]


# Point target


def test_point_target_adds_its_amplitude_to_one_cell_of_each_frame():
    noise, cells = (
        np.random.default_rng(0).normal(size=(3, 4, 5)),
        np.array([[0, 0], [3, 4], [1, 2]]),
    )
    amplitude = dp_tbd.point_amplitude(9.0)
    assert amplitude == pytest.approx(2.8184, abs=5e-5)
    added = dp_tbd.point_frames(noise, cells, amplitude) - noise
    assert np.count_nonzero(added) == 3
    np.testing.assert_allclose([added[k][tuple(cells[k])] for k in range(3)], amplitude, rtol=1e-12)


@pytest.mark.parametrize(
    "cells", [[[0, 0]] * 2, [[0, 0], [4, 0], [0, 0]], [[0, 0], [0, 0], [0, -1]]]
)
def test_point_target_outside_the_frame_is_refused_in_one_line(cells):
    with pytest.raises(ValueError, match="point_frames: cells") as error:
        dp_tbd.point_frames(np.zeros((3, 4, 5)), np.array(cells), 1.0)
    assert "\n" not in str(error.value)
