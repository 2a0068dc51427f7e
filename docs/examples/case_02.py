from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording
from tbdcore.recording import misfit

page, rng = tbdcore.page("mm_pf_tbd"), np.random.default_rng(2)
file = np.load("build/counts.npz")
raw, path = file["frames"], file["path"]
z = recording.normalise(raw, recording.background(raw[:1000]))
print(misfit.fit(z[:1000]))
scene = page.Scene(nx=40, ny=32, blur=0.6, noise=1.0, amplitude=2 * np.pi * 0.6**2 * 4.0)
p = page.Scenario(M=3400, M_new=3400, scene=scene)
empty = page.run(z[:600], p, rng).existence
gamma = recording.threshold(empty, 10 / 1000, independent=200)  # successive frames depend
print(gamma)
p = replace(p, gamma=gamma.value)
control, found = page.run(z[600:1000], p, rng), page.run(z[1000:], p, rng)
print("declared", found.declared.mean(), "and, without a target,", control.declared.mean())
place = found.s[found.declared][:, [0, 2]] - 1  # this chapter counts cells from 1
plt.plot(*path.T, "c-", lw=4, label="truth")
plt.plot(*place.T, "C1.", label="declared")
plt.gca().set(xlabel="first axis (cells)", ylabel="second axis (cells)", xlim=(0, 40), ylim=(0, 32))
plt.legend()
plt.savefig("build/case_02.png")
