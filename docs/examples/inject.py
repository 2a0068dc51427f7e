import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording

page, rng, k = tbdcore.page("dp_tbd"), np.random.default_rng(4), np.arange(10)
raw = np.load("build/counts.npz")["frames"][:1000]  # your frames without a target
z = recording.normalise(raw, recording.background(raw))
path, strengths = np.c_[8 + 0.4 * k, 6 + 0.3 * k], np.arange(0.0, 4.1, 0.5)
blocks = recording.blocks(z, 10)  # half of them for the threshold, half to try
for K in (5, 10):
    p = page.Scenario(K=K, grid=(40, 32), M=1)
    V_T = recording.threshold(page.noise_maxima(blocks[:50, -K:], p), 0.05).value
    found = []
    for strength in strengths:
        tried = [recording.inject(z, path, strength, 0.6, rng)[-K:] for z in blocks[50:]]
        ends = [[t.cells[-1] for t in page.detect(z, p, V_T, most=1)] for z in tried]
        found.append(np.mean([any(abs(end - path[-1]).max() <= 2 for end in e) for e in ends]))
    error = np.sqrt((np.array(found) + 0.01) * (1.01 - np.array(found)) / 50)
    plt.errorbar(strengths, found, error, marker=".", capsize=2, label=f"blocks of {K} frames")
plt.xlabel("peak of the target (standard deviations of the noise)")
plt.ylabel("share found within two cells")
plt.legend()
plt.savefig("build/found.png")
