from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import expit, logit

import tbdcore
from tbdcore import noise, recording
from tbdcore.recording import misfit

page, rng = tbdcore.page("mm_pf_tbd"), np.random.default_rng(2)
file = np.load("build/counts.npz")
raw, path = file["frames"], file["path"]
z = recording.normalise(raw, recording.background(raw[:1000]))
print(misfit.fit(z[:1000]))
scene = page.Scene(nx=40, ny=32, blur=0.6, noise=1.0, amplitude=2 * np.pi * 0.6**2 * 4.0)
p = page.Scenario(M=3400, M_new=3400, scene=scene)


def largest(frames):  # log-odds of existence in blocks of 10 frames, which depend less
    existence = page.run(frames, p, rng).existence
    return logit(recording.blocks(existence[:, None, None], 10).max(axis=(1, 2, 3)))


own, control = largest(z[:600]), largest(z[600:1000])
level = recording.threshold(own, 10 * 10 / 1000)  # 10 frames in 1000 without a target
found = page.run(z[1000:], replace(p, gamma=float(expit(level.value))), rng)
white = largest(noise.gaussian((300, 40, 32), rng))
said = recording.outcome(z, level, own, white, control)
print(said)
print("declared in", found.declared.mean(), "of the frames with the target")
place = found.s[found.declared][:, [0, 2]] - 1  # this chapter counts cells from 1
plt.plot(*path.T, "c-", lw=4, label="truth")
plt.plot(*place.T, "C1.", label="declared")
plt.gca().set(xlabel="first axis (cells)", ylabel="second axis (cells)", xlim=(0, 40), ylim=(0, 32))
plt.legend()
plt.savefig("build/case_02.png")
