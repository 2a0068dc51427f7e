"""Dynamic programming against the enumeration of all paths, against SciPy, against closed forms,
and under symmetries.
"""

import itertools

import numpy as np
import pytest
from scipy import ndimage

from tbdcore import dynprog

ONE = np.ones(1)
A = 0.95
ASIDE = np.array([A, 1.0, A])
LITERAL = np.array([[A ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])


def none(z):
    """Frames of no maps: all is computed."""
    return np.full_like(z, np.nan)


def algorithm(name, M):
    """(number of velocities, lowest velocity, forward pass, path to a state); margin M + 1."""
    back = dynprog.weighted_path
    fixed = {
        "conventional": np.ones(2 * M + 1),
        "tonissen": np.array([0.0, 1.0, 1.0]),
        "unweighted": np.ones(3),
    }
    if name == "conventional":
        w = fixed[name]
        return (
            1,
            0,
            lambda z, I, held: dynprog.box_forward(z, w, 0, M + 1, I, held),
            lambda I, x: back(I, x, w, ONE, 0),
        )
    v = 1 - M
    if name == "tonissen":
        w = fixed[name]
        return (
            2 * M,
            v,
            lambda z, I, held: dynprog.box_forward(z, w, v, M + 1, I, held),
            lambda I, x: back(I, x, w, ONE, v),
        )
    if name == "literal":
        step = dynprog.coupled_path
        return (
            *(2 * M, v),
            lambda z, I, held: dynprog.coupled_forward(z, LITERAL, v, M + 1, I, held),
            lambda I, x: step(I, x, LITERAL, v),
        )
    if name == "penalised":
        c, step = np.array([0.4, 0.0, 0.4]), dynprog.penalised_path
        return (
            2 * M,
            v,
            lambda z, I, held: dynprog.penalised_forward(z, c, c, v, M + 1, I, held),
            lambda I, x: step(I, x, c, c, v),
        )
    w = ASIDE if name == "weighted" else fixed[name]
    return (
        2 * M,
        v,
        lambda z, I, held: dynprog.weighted_forward(z, w, w, v, M + 1, I, held),
        lambda I, x: back(I, x, w, w, v),
    )


def solve(z, name, M):
    """Value maps without their margin (K, V, V, Nx, Ny), and the best path of states, cells counted
    from 0.
    """
    V, _, forward, back = algorithm(name, M)
    z = dynprog.margin(z, M + 1)
    I = forward(z, np.empty((len(z), V, V, *z.shape[1:])), none(z))
    path = back(I, np.unravel_index(I[-1].argmax(), I[-1].shape))
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
    z = dynprog.margin(np.random.default_rng(8).normal(-1.0, 1.0, (4, 12, 9)), 4)
    ours, theirs = np.empty((2, 4, 6, 6, 20, 17))
    dynprog.weighted_forward(z, ASIDE, ASIDE, -2, 4, ours, none(z))
    dynprog.coupled_forward(z, np.outer(ASIDE, ASIDE), -2, 4, theirs, none(z))
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
    z, w = dynprog.margin(DATA.astype(np.float32), 4), ASIDE.astype(np.float32)
    I = np.empty((len(z), 6, 6, *z.shape[1:]), np.float32)
    dynprog.weighted_forward(z, w, w, -2, 4, I, none(z))
    np.testing.assert_allclose(
        I[-1][..., 4:-4, 4:-4], solve(DATA, "weighted", 3)[0][-1], rtol=2e-6, atol=2e-6
    )


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [0, 5])
@pytest.mark.parametrize("name", ["weighted", "coupled", "penalised"])
def test_the_path_reaches_both_ends_of_the_velocities(name, end, axis):
    """The only finite predecessor has the lowest or highest velocity; the state is one above it or
    below, and at the end itself.
    """
    weights = {"weighted": (ASIDE, ASIDE), "coupled": (LITERAL,)}.get(name, (1 - ASIDE, 1 - ASIDE))
    for offset in (0, 1):
        state, before = [2, 2, 9, 9], [2, 2, 9, 9]
        before[axis], state[axis] = end, abs(end - offset)
        for a in (0, 1):
            before[2 + a] = 9 - (before[a] - 2)  # slack 0: the cell left at the former velocity
        I = np.full((2, 6, 6, 20, 20), -np.inf)
        I[0][tuple(before)] = 1.0
        path = getattr(dynprog, f"{name}_path")(I, tuple(state), *weights, -2)
        assert path[0].tolist() == before


# Bad input


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (np.zeros((5, 5)), "(5, 5) is not (K, Nx, Ny)"),
        (np.ma.zeros((2, 5, 5)), "a masked array; fill it"),
        (np.zeros((2, 0, 5)), "none empty"),
        (
            np.where(np.arange(24).reshape(2, 3, 4) == 17, np.nan, 0.0),
            "frames[1, 1, 1] is nan; replace it",
        ),
        (np.where(np.arange(24).reshape(2, 3, 4) == 3, np.inf, 0.0), "frames[0, 0, 3] is inf"),
    ],
)
def test_bad_frames_are_one_line(frames, message):
    with pytest.raises(ValueError, match="^frames") as error:
        dynprog.margin(frames, 3)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "slack", [np.ones(4), [1, 0, 1], [1, 1, -1], [np.nan, 1, 1], np.ones((3, 3))]
)
def test_bad_windows_are_one_line(slack):
    z = dynprog.margin(np.zeros((2, 9, 9)), 4)
    with pytest.raises(ValueError, match="^weights: [^\n]+$"):
        dynprog.box_forward(z, np.array(slack, float), 0, 4, np.empty((2, 1, 1, 17, 17)), none(z))


BAD_FORWARD = {
    "a frame short": lambda z, w, v, r, I: (z[:1], w, w, v, r, I),
    "transposed maps": lambda z, w, v, r, I: (z, w, w, v, r, I.swapaxes(-1, -2)),
    "transposed frames": lambda z, w, v, r, I: (z.swapaxes(1, 2), w, w, v, r, I),
    "two dimensions": lambda z, w, v, r, I: (z[0], w, w, v, r, I),
    "mixed types": lambda z, w, v, r, I: (z, w.astype(np.float32), w, v, r, I),
    "integers": lambda z, w, v, r, I: tuple(
        np.zeros(a.shape, int) if isinstance(a, np.ndarray) else a for a in (z, w, w, v, r, I)
    ),
    "complex": lambda z, w, v, r, I: (z + 0j, w, w, v, r, I),
    "NaN weight": lambda z, w, v, r, I: (z, w * np.nan, w, v, r, I),
    "negative weight": lambda z, w, v, r, I: (z, w, w * [-1, 1, 1], v, r, I),
    "forbidden middle": lambda z, w, v, r, I: (z, w, w * [1, 0, 1], v, r, I),
    "infinite weight": lambda z, w, v, r, I: (z, w, w * [np.inf, 1, 1], v, r, I),
    "velocity below the margin": lambda z, w, v, r, I: (z, w, w, v - 2, r, I),
    "velocity above the margin": lambda z, w, v, r, I: (z, w, w, v + 2, r, I),
    "velocity out of range": lambda z, w, v, r, I: (z, w, w, -(2**63), r, I),
    "no whole velocity": lambda z, w, v, r, I: (z, w, w, v + 0.5, r, I),
    "negative margin": lambda z, w, v, r, I: (z, w, w, v, -r, I),
    "a margin as wide as the frame": lambda z, w, v, r, I: (z, w, w, v, 100, I),
    "no map": lambda z, w, v, r, I: (z, w, w, v, r, I[:, :0, :0]),
    "maps not square": lambda z, w, v, r, I: (z, w, w, v, r, I[:, :, :4].copy()),
    "a list": lambda z, w, v, r, I: (z, w.tolist(), w, v, r, I),
}


@pytest.mark.parametrize("name", BAD_FORWARD)
def test_bad_arguments_of_a_forward_pass_are_one_line(name):
    z = dynprog.margin(np.zeros((2, 9, 7)), 4)
    I = np.empty((2, 6, 6, *z.shape[1:]))
    dynprog.weighted_forward(z, ASIDE, ASIDE, -2, 4, I, none(z))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.weighted_forward(*BAD_FORWARD[name](z, ASIDE, -2, 4, I), none(z))


@pytest.mark.parametrize("held", [(1, 17, 15), (2, 15, 17), (2, 17, 15, 1)])
def test_held_frames_of_another_shape_are_refused(held):
    z, I = dynprog.margin(np.zeros((2, 9, 7)), 4), np.empty((2, 6, 6, 17, 15))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.weighted_forward(z, ASIDE, ASIDE, -2, 4, I, np.zeros(held))


@pytest.mark.parametrize("name", NAMES)
def test_frames_that_do_not_differ_are_not_computed_again(name):
    V, _, forward, _ = algorithm(name, 3)
    z, I = dynprog.margin(DATA, 4), np.full((len(DATA), V, V, 22, 19), 7.0)
    forward(z, I, z)
    assert (I == 7.0).all()


@pytest.mark.parametrize("name", NAMES)
def test_what_a_cell_cannot_reach_is_not_computed_again(name):
    """A cell of the last frame changes its row of the last map; frame 4, its own row of map 4 and
    at most four rows on either side in map 5.
    """
    V, _, forward, _ = algorithm(name, 3)
    z = dynprog.margin(DATA, 4)
    for k in (5, 4):
        new, I = z.copy(), np.full((len(DATA), V, V, 22, 19), 7.0)
        new[k, 11, 9] += 1.0
        forward(new, I, z)
        rows = [np.flatnonzero((I[k] != 7.0).any(axis=(0, 1, 3))) for k in range(len(DATA))]
        assert not any(row.size for row in rows[:k])
        assert rows[k].tolist() == [11]
        assert k == 5 or 11 - 3 - 1 <= rows[5].min() <= rows[5].max() <= 11 + 3 + 1


@pytest.mark.parametrize(
    "state",
    [
        (0, 0, 0),
        (6, 0, 5, 5),
        (0, -1, 5, 5),
        (0, 0, 20, 5),
        (0.0, 0, 5, np.nan),
        [0, 0, 5, 5],
        None,
    ],
)
def test_a_final_state_outside_the_maps_is_refused(state):
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.weighted_path(np.zeros((2, 6, 6, 20, 20)), state, ASIDE, ASIDE, -2)


FLAT = [LITERAL.reshape(9, 1), LITERAL.reshape(1, 9)]
HOLE = LITERAL * (np.arange(9).reshape(3, 3) != 0)


@pytest.mark.parametrize(
    "table", [LITERAL[:2], -LITERAL, LITERAL * np.nan, LITERAL * 0, HOLE, ASIDE, *FLAT]
)
def test_a_bad_table_is_refused(table):
    z, I = dynprog.margin(np.zeros((2, 9, 7)), 4), np.zeros((2, 6, 6, 17, 15))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.coupled_forward(z, table, -2, 4, I, none(z))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.coupled_path(I, (0, 0, 5, 5), table, -2)


@pytest.mark.parametrize("price", [[-1, 0, 1], [0, np.inf, 0], [np.nan, 0, 0], [0, 0]])
def test_a_bad_price_is_refused(price):
    z, I, c = dynprog.margin(np.zeros((2, 9, 7)), 4), np.zeros((2, 6, 6, 17, 15)), np.zeros(3)
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.penalised_forward(z, np.array(price, float), c, -2, 4, I, none(z))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.penalised_path(I, (0, 0, 5, 5), c, np.array(price, float), -2)


def test_slacks_that_are_no_neighbours_are_refused():
    z = dynprog.margin(np.zeros((2, 12, 12)), 4)
    with pytest.raises(ValueError, match="must be neighbours"):
        dynprog.box_forward(
            z, np.array([1.0, 0, 1, 1, 1]), -1, 4, np.empty((2, 3, 3, *z.shape[1:])), none(z)
        )


def test_a_margin_that_a_step_could_leave_is_refused():
    z = dynprog.margin(np.zeros((2, 6, 6)), 2)
    I = np.empty((2, 1, 1, 10, 10))
    with pytest.raises(ValueError, match="margin"):
        dynprog.box_forward(z, np.ones(7), 0, 2, I, none(z))
    with pytest.raises(ValueError, match="middle one positive"):
        dynprog.weighted_forward(z, np.ones(5), np.ones(3), 0, 2, I, none(z))
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        dynprog.box_forward(z, np.ones((3, 1)), 0, 2, I, none(z))


@pytest.mark.parametrize("left_out", [2, [1, 2], [2, 3]])
def test_a_window_without_slack_zero_is_refused(left_out):
    z, position = dynprog.margin(np.zeros((2, 9, 9)), 4), np.ones(5)
    position[left_out] = 0.0
    with pytest.raises(ValueError, match="middle one positive"):
        dynprog.box_forward(z, position, 0, 4, np.empty((2, 1, 1, 17, 17)), none(z))


@pytest.mark.parametrize("cell", [(0, 0), (0, 4), (4, 0), (4, 4)])
def test_a_path_reaches_the_first_and_the_last_cell_of_a_map(cell):
    I = np.zeros((2, 1, 1, 5, 5))
    I[0, 0, 0][cell] = 1.0
    start = tuple(min(max(c, 1), 3) for c in cell)
    path = dynprog.weighted_path(I, (0, 0, *start), np.ones(3), np.ones(1), 0)
    assert path.tolist() == [[0, 0, *cell], [0, 0, *start]]
