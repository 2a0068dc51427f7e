"""The accumulation filter: one trial of 200 frames of 500 x 90 cells with 8000 particles, and its
patch likelihood.

The specification of the likelihood sums dense frames, one particle after the other.  The machine's
limit is what the patches cost without any thought: read 65 cells of each particle and divide once
per cell, nothing else.  The peer is the filter as it is written in NumPy, all particles at once:
the 65 cells gathered by index arrays, a logarithm per cell.  It replaces
``power_log_ratio`` on the very page that the notebook shows, so that both trials run on the same
frames in one process. Asked are 0.30 s for a trial.
"""

from dataclasses import replace
from unittest import mock

import numpy as np

import tbdcore
from benchmarks.timing import Row, best
from tbdcore import kernel
from tbdcore.kernels import mda_tbd

TRUE = mda_tbd.Spread(1.44, 1460 * np.radians(0.5) ** 2, 2, 6)


def numpy_log_ratio(z, rho, alpha, snr, spread):
    """Equation (17) for all particles at once, (N, 5, 13) cells."""
    i0, j0 = (
        np.floor(np.nan_to_num(rho) + 0.5).astype(int),
        np.floor(np.nan_to_num(alpha) + 0.5).astype(int),
    )
    i = i0[:, None] + np.arange(-spread.hr, spread.hr + 1)
    j = j0[:, None] + np.arange(-spread.ha, spread.ha + 1)
    there = ((i >= 1) & (i <= z.shape[0]))[:, :, None] & ((j >= 1) & (j <= z.shape[1]))[:, None, :]
    cells = z[
        np.clip(i - 1, 0, z.shape[0] - 1)[:, :, None], np.clip(j - 1, 0, z.shape[1] - 1)[:, None, :]
    ]
    hr, ha = (
        np.exp(-spread.lr * (i - rho[:, None]) ** 2),
        np.exp(-spread.la * (j - alpha[:, None]) ** 2),
    )
    s = snr[:, None, None] * hr[:, :, None] * ha[:, None, :] * there
    out = (cells * s / (1 + s) - np.log1p(s)).sum(axis=(1, 2))
    inside = (i0 >= 1) & (i0 <= z.shape[0]) & (j0 >= 1) & (j0 <= z.shape[1])
    return np.where(inside, out, -np.inf)


@kernel
def read_and_divide(z, rho, alpha, spread):
    """The machine's limit: 65 loads and 65 divisions per particle."""
    total = 0.0
    for n in range(rho.size):
        i0, j0 = int(rho[n] + 0.5) - 1, int(alpha[n] + 0.5) - 1
        for i in range(max(i0 - spread.hr, 0), min(i0 + spread.hr + 1, z.shape[0])):
            for j in range(max(j0 - spread.ha, 0), min(j0 + spread.ha + 1, z.shape[1])):
                total += 1.0 / (1.0 + z[i, j])
    return total


def whole_trial(page, p):
    """Frames, filter and history of one trial."""
    rng = np.random.default_rng(2)
    return page.recursion(page.simulate(page.Scene(), rng, rng), p, rng)


def rows():
    """Likelihood kernels with 8000 particles around a target, and whole trials."""
    rng = np.random.default_rng(1)
    z = rng.standard_exponential((500, 90), dtype=np.float32)
    rho, alpha, snr = (
        250 + 5 * rng.normal(size=8000),
        12 + 1.5 * rng.normal(size=8000),
        np.full(8000, 4.0),
    )
    assert np.allclose(
        mda_tbd.power_log_ratio(z, rho, alpha, snr, TRUE),
        numpy_log_ratio(z, rho, alpha, snr, TRUE),
        rtol=1e-9,
    )
    few = rho[:100], alpha[:100], snr[:100]
    ours, limit = (
        best(mda_tbd.power_log_ratio, z, rho, alpha, snr, TRUE),
        best(read_and_divide, z, rho, alpha, TRUE),
    )
    peer = best(numpy_log_ratio, z, rho, alpha, snr, TRUE, repeat=3)
    spec = 80 * best(mda_tbd.power_log_ratio_spec, z, *few, TRUE, repeat=2)
    yield Row(
        "mda_tbd.power_log_ratio", "8000 particles, 5 x 13 cells", ours, spec, limit, "NumPy", peer
    )
    fit, fit_spec = (
        best(mda_tbd.patch_fit, z, rho, alpha, TRUE),
        80 * best(mda_tbd.patch_fit_spec, z, *few[:2], TRUE, repeat=2),
    )
    yield Row("mda_tbd.patch_fit", "8000 particles, 5 x 13 cells", fit, fit_spec)
    cell, cell_spec = (
        best(mda_tbd.cell_power, z, rho, alpha),
        80 * best(mda_tbd.cell_power_spec, z, *few[:2], repeat=2),
    )
    yield Row("mda_tbd.cell_power", "8000 particles", cell, cell_spec)
    H, age, ancestors = (
        rng.random((8, 1, 8000)),
        np.zeros(8000, int),
        np.sort(rng.integers(0, 8000, 6000)),
    )
    moved, moved_spec = (
        best(f, H, age, ancestors, 2000) for f in (mda_tbd.inherit, mda_tbd.inherit_spec)
    )
    yield Row("mda_tbd.inherit", "8 frames, 6000 of 8000 particles", moved, moved_spec)
    page = tbdcore.page("mda_tbd")
    for name, p in {
        "proposed": page.Filter(),
        "mainstream": page.Filter(source="state"),
    }.items():
        fast = best(whole_trial, page, p, repeat=3)
        with mock.patch.object(mda_tbd, "power_log_ratio", numpy_log_ratio):
            slow = best(whole_trial, page, replace(p), repeat=1)
        yield Row(
            f"trial, {name}",
            "frames, 8000 particles, 200 frames",
            fast,
            None,
            None,
            "NumPy",
            slow,
            0.30,
        )
