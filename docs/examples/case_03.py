import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording
from tbdcore.recording import misfit

page, rng = tbdcore.page("mda_tbd"), np.random.default_rng(3)
file = np.load("build/samples.npz")
raw, path = abs(file["samples"]) ** 2, file["path"]  # complex samples: their power
z = recording.normalise(raw, recording.background(raw[:1000], "exponential"), "exponential")
print(misfit.fit(z[:1000], "exponential"))
cells = {"nr": 48, "na": 32, "dr": 5.0, "da": 0.01, "r_min": 2000.0}  # m, rad, m
p = page.scenario(**cells, sd_r=1.5, sd_a=1.5, source="averaged", births="power", N=3000, B=1000)
empty = page.run(z[:800], p, rng).existence
largest = recording.blocks(empty[:, None, None], 20).max(axis=(1, 2, 3))
level = recording.threshold(largest, 5 * 20 / 1000)  # 5 false declarations in 1000 frames
print(level)
control, found = page.run(z[800:1000], p, rng), page.run(z[1000:], p, rng)
on = found.existence > level.value
print("declared", on.mean(), "and, without a target,", (control.existence > level.value).mean())
r, a = 2000 + 5.0 * (path[:, 0] + 0.5), 0.01 * (path[:, 1] + 0.5)
plt.plot(r * np.cos(a), r * np.sin(a), "c-", lw=4, label="truth")
plt.plot(*found.x[on][:, ::2].T, "C1.", label="declared")
plt.gca().set(xlabel="x (m)", ylabel="y (m)")
plt.legend()
plt.savefig("build/case_03.png")
