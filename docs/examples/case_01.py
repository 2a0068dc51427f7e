import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import noise, recording
from tbdcore.recording import misfit

page, rng, file = tbdcore.page("dp_tbd"), np.random.default_rng(2), np.load("build/counts.npz")
raw, path = file["frames"][1000:], file["path"]  # 60 frames, the target is in each
print("kept", recording.kept(raw, 0.4, 4 * 20, 0.6, recording.background, rng))
at = recording.background(raw)  # 60 frames measure the spread of a cell to 11 %: one for all
z = recording.normalise(raw, recording.Level(at.mean, np.median(at.std)))
print(misfit.fit(z))  # nothing may be "exceeded"
K, nx, ny = 10, 40, 32
whole = page.Scenario(K=K, grid=(nx, ny), M=1)  # up to one cell per frame on each axis
small = page.Scenario(K=K, grid=(10, 8), M=1)  # 16 windows in a frame
white = page.noise_maxima(noise.gaussian((200, K, 10, 8), rng), small)
away = np.full((len(z), 2), np.nan)  # where a target is declared
for first in (True, False):
    cut = recording.windows(z, K, (10, 8), away=away)
    peaks = page.noise_maxima(cut.blocks, small)
    own, control = peaks[~cut.control], peaks[cut.control]
    if first:  # the target is in some of its blocks
        own = np.delete(own, recording.suspects(own, white))
    level = recording.threshold(own, 0.05 / 16, tail="gumbel")  # 5 % of searches of a frame
    found = [page.detect(z[k : k + K], whole, level.value, most=1) for k in range(0, len(z), K)]
    for k, tracks in enumerate(found):
        for track in tracks:
            away[K * k : K * (k + 1)] = track.cells
said = recording.outcome(z, level, own, white, control)
print(said)
print("blocks with a path", sum(map(bool, found)), "of", len(found))
plt.imshow(z.mean(axis=0), cmap="Greys")
plt.plot(*path[:, ::-1].T, "c-", lw=4, label="truth")
plt.plot(*away[:, ::-1].T, "C1.", label="declared")
plt.xlabel("second axis (cells)")
plt.ylabel("first axis (cells)")
plt.legend()
plt.savefig("build/case_01.png")
