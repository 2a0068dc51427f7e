"""Sensor: what a frame of cells looks like, and what it says about a target.

Track-before-detect works on the frame itself.  A frame is an array of cells ``z`` of shape (n_x, n_y), or (K, n_x, n_y) for K
frames in a row; **the first axis is the first index of the paper** (x, or range), the second is the second (y, or azimuth).
Papers count cells from 1, arrays from 0: cell (i, j) is ``z[i - 1, j - 1]``.  Pictures that show x to the right are pictures of
``z.T``.

Each section below is one kind of sensor, with its signal, its noise, and the two functions that a filter needs of it: a
simulated frame, and the log-likelihood ratio of "target at this state" against "noise only".

=======================  =====================================================  =============================================
section                  signal in a cell                                       noise in a cell
=======================  =====================================================  =============================================
Gaussian image           h: Gaussian blob, amplitude known                      normal, standard deviation sigma
point target             all of the target's signal in one cell                 its own section says
range and azimuth        power of a Gaussian blob, amplitude unknown            exponential power
=======================  =====================================================  =============================================

Why a *ratio*, and why a *patch*: cells are independent, so the likelihood of a whole frame is a product over cells, and every
cell that the target does not reach has the same factor under both hypotheses.  Divided by the likelihood of noise these factors
are 1, and what remains of a product over all cells is one over the few cells around the target.  A target outside the
frame illuminates nothing, its ratio is 1, its log-ratio 0: the data speak neither for it nor against it.

For a known signal h and normal noise the log-ratio of one cell is h (2 z - h) / (2 sigma**2).  Summed over the patch it is
normal too, with mean +d**2/2 if the target is there and -d**2/2 if not, and variance d**2, where d**2 = sum h**2 / sigma**2
is the energy that a matched filter collects.  d is all there is to know about the strength of such a target.
"""

import math

import numpy as np

from tbdcore import kernel

# Gaussian image: a blob of known amplitude in normal noise ----------------------------------------------------------------


def blob_peak(intensity, blur, delta=1.0):
    """Amplitude of the blob's centre, delta**2 I / (2 pi blur**2), in units of the noise's z."""
    return delta * delta * intensity / (2.0 * math.pi * blur * blur)


def blob_image(x, y, peak, blur, shape):
    """Noise-free frames h of a Gaussian blob: (n_x, n_y) for numbers x, y, (K, n_x, n_y) for K positions.

    x, y : position in cells; cell (i, j) is centred at (i, j), i = 1 .. n_x, j = 1 .. n_y.  NaN: no target, h = 0.
    peak : amplitude at the centre; blur : standard deviation of the blob in cells; shape : (n_x, n_y).
    """
    gx, gy = (
        np.exp(-((np.arange(1, n + 1) - np.asarray(v, float)[..., None]) ** 2) / (2.0 * blur * blur))
        for v, n in zip((x, y), shape, strict=True)
    )
    return np.nan_to_num(peak * gx[..., :, None] * gy[..., None, :], nan=0.0)


def blob_log_ratio_spec(z, S, r, peak, blur, noise):
    """Specification of :func:`blob_log_ratio`: every cell of the frame, and a mask for the patch."""
    out = np.zeros(len(r))
    i, j = (np.arange(1, n + 1) for n in z.shape)
    for n in np.flatnonzero(r):
        x, y = S[n, 0], S[n, 2]
        near = np.outer(np.abs(i - np.floor(x + 0.5)) <= 2, np.abs(j - np.floor(y + 0.5)) <= 2)
        h = peak * np.exp(-np.add.outer((i - x) ** 2, (j - y) ** 2) / (2 * blur**2))
        inside = 0.5 <= x < z.shape[0] + 0.5 and 0.5 <= y < z.shape[1] + 0.5
        out[n] = inside * (h * (2 * z - h) / (2 * noise**2))[near].sum()
    return out


@kernel
def _row(z, i, j, a, b, c, d):
    """Five cells of row i from column j on, weighted by a, b, 1, c, d."""
    return a * z[i, j] + b * z[i, j + 1] + z[i, j + 2] + c * z[i, j + 3] + d * z[i, j + 4]


@kernel
def blob_log_ratio(z, S, r, peak, blur, noise):
    """Log-likelihood ratio (N,) of the 5 x 5 patch around each particle: target with that state against noise only.

    z : (n_x, n_y) frame; S : (N, d) states, x in column 0 and y in column 2, in cells; r : (N,) regimes, 0 absent.
    peak, blur, noise : amplitude of the blob, its standard deviation in cells, standard deviation of z.
    Absent particles, and particles outside the frame, have log-ratio 0.  The patch is clipped at the edge; it holds all but
    1e-7 of the energy of a blob of 0.6 cells (1e-4 at 0.8, 0.2 % at one cell), and is too small for wider blobs.

    The sum over the patch is  (peak sum g_i g_j z_ij - peak**2 / 2 sum g_i**2 sum g_j**2) / noise**2,  and the Gaussian is
    a recurrence: with d the offset to the nearest cell, its value m cells further is
    exp(-d**2 / 2b**2) * exp(-d / b**2)**m * exp(-m**2 / 2b**2), so three exponentials serve 25 cells.
    """
    nx, ny = z.shape
    k = 1.0 / (blur * blur)
    one, two = math.exp(-0.5 * k), math.exp(-2.0 * k)
    framed = np.zeros((nx + 4, ny + 4))
    framed[2 : nx + 2, 2 : ny + 2] = z
    out = np.zeros(r.size)
    for n in range(r.size):
        x, y = S[n, 0], S[n, 2]
        if r[n] == 0 or not (0.5 <= x < nx + 0.5 and 0.5 <= y < ny + 0.5):
            continue
        i, j = int(x + 0.5), int(y + 0.5)
        dx, dy = i - x, j - y
        centre = math.exp(-0.5 * k * (dx * dx + dy * dy))
        q, p = math.exp(-k * dx), math.exp(-k * dy)
        u, v = 1.0 / q, 1.0 / p
        a, b, c, d = u * u * two * (i > 2), u * one * (i > 1), q * one * (i < nx), q * q * two * (i < nx - 1)
        e, f, g, h = v * v * two * (j > 2), v * one * (j > 1), p * one * (j < ny), p * p * two * (j < ny - 1)
        match = a * _row(framed, i - 1, j - 1, e, f, g, h) + b * _row(framed, i, j - 1, e, f, g, h)
        match += c * _row(framed, i + 2, j - 1, e, f, g, h) + d * _row(framed, i + 3, j - 1, e, f, g, h)
        match += _row(framed, i + 1, j - 1, e, f, g, h)
        energy = (a * a + b * b + 1.0 + c * c + d * d) * (e * e + f * f + 1.0 + g * g + h * h)
        out[n] = peak * centre * (match - 0.5 * peak * centre * energy) / (noise * noise)
    return out
