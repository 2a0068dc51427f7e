import matplotlib.pyplot as plt
import numpy as np
from scipy.special import logit

import tbdcore
from tbdcore import noise, recording
from tbdcore.recording import misfit

page, rng = tbdcore.page("mda_tbd"), np.random.default_rng(3)
file = np.load("build/samples.npz")
raw, path = abs(file["samples"]) ** 2, file["path"]  # complex samples: their power
z = recording.normalise(raw, recording.background(raw[:1000], "exponential"), "exponential")
print(misfit.fit(z[:1000], "exponential"))
cells = {"nr": 48, "na": 32, "dr": 5.0, "da": 0.01, "r_min": 2000.0}  # m, rad, m
p = page.scenario(
    **cells, sd_r=1.5, sd_a=1.5, source="averaged", births="power", birth_speed=8.0, N=3000, B=1000
)


def largest(frames):  # log-odds of existence in blocks of 20 frames
    existence = page.run(frames, p, rng).existence
    return logit(recording.blocks(existence[:, None, None], 20).max(axis=(1, 2, 3)))


own, control = largest(z[:800]), largest(z[800:1000])
level = recording.threshold(own, 5 * 20 / 1000)  # 5 false declarations in 1000 frames
found = page.run(z[1000:], p, rng)
on = logit(found.existence) > level.value
white = largest(noise.exponential((200, 48, 32), rng))
said = recording.outcome(z, level, own, white, control, "exponential")
print(said)
print("declared in", on.mean(), "of the frames with the target")
r, a = 2000 + 5.0 * (path[:, 0] + 0.5), 0.01 * (path[:, 1] + 0.5)
plt.plot(r * np.cos(a), r * np.sin(a), "c-", lw=4, label="truth")
plt.plot(*found.x[on][:, ::2].T, "C1.", label="declared")
plt.gca().set(xlabel="x (m)", ylabel="y (m)")
plt.legend()
plt.savefig("build/case_03.png")
