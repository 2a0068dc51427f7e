import numpy as np

from tbdcore import noise, recording

rng, k = np.random.default_rng(1), np.arange(60)
path = np.full((1060, 2), np.nan)  # 1000 frames without a target, 60 with one
path[1000:] = np.c_[6 + 0.4 * k, 6 + 0.3 * k]
scene = 100 + np.linspace(0, 60, 40)[:, None] + 9 * rng.random((40, 32))  # stands still
counts = scene + 20 * noise.gaussian((1060, 40, 32), rng)
counts = recording.inject(counts, path, 4 * 20, 0.6, rng)
np.savez("build/counts.npz", frames=counts, path=path[1000:])

power = noise.sloped(noise.exponential((1060, 48, 32), rng), 0.8)  # the noise has a slope
power = recording.inject(power, path, 8.0, 1.5, rng, "exponential")
samples = 6 * np.sqrt(power) * np.exp(2j * np.pi * rng.random(power.shape))
np.savez("build/samples.npz", samples=samples, path=path[1000:])

t = np.cumsum(rng.uniform(3.5, 4.5, 40))  # s, range (m), azimuth (deg); strengths above 6
true = np.c_[t, 20e3 - 100 * t, 30 + 0.03 * t]
false = true[2:].repeat(1000, axis=0) + rng.uniform([0, -1e3, -10], [0, 1e3, 10], (38000, 3))
rows = np.r_[true + rng.normal(0, [0, 10, 0.1], true.shape), false]
strength = 2 * rng.standard_exponential(len(rows))
strength[:40] *= 30
strength[:2] = 60
rows = np.c_[rows, strength][strength > 6]
np.savetxt("build/plots.csv", rows[rows[:, 0].argsort(kind="stable")], delimiter=",")
np.savetxt("build/plots_true.csv", true, delimiter=",")

t, rows, true = np.cumsum(rng.uniform(1.6, 1.8, 60)), [], []
for k, s in enumerate(t):  # s, own place and plots (m, north and east); a third boat from scan 15
    own = np.array([0.5 * s, 0.0])
    boats = np.array([[100 + s, 2 * s - 80], [60 + 2 * s, 90 - s], [250 - 2 * s, 60 - s]])
    boats = boats[: 2 + (k >= 15)]
    ends = (boats[:, None] + [[-4, 0], [4, 0]]).reshape(-1, 2)  # a plot of bow and stern
    seen = ends[rng.random(len(ends)) < 0.9] + 0.0
    seen = np.r_[seen + 2 * rng.standard_normal(seen.shape), rng.uniform(-300, 300, (4, 2))]
    rows += [[s, *own, *(z - own)] for z in seen]
    true += [[s, *z] for z in boats]
np.savetxt("build/boats.csv", rows, delimiter=",")
np.savetxt("build/boats_true.csv", true, delimiter=",")
