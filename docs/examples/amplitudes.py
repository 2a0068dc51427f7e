import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording

page, rng = tbdcore.page("ljipda_ai"), np.random.default_rng(5)
x = np.array([[5000.0, 10, 0, 5]])  # a target of 12 dB; the receiver counts in units of 7
scans = []
for k in range(30):
    seen = x[:, ::2] + k * x[:, 1::2] + rng.normal(0, 10, (1, 2))
    places = np.r_[seen, rng.uniform([4800, -200], [5400, 300], (20, 2))]
    power = np.r_[15.0, np.ones(20)] * rng.standard_exponential(21)
    scans.append(np.c_[places, 7 * np.sqrt(2 * power + 2.0**2)])

raw = np.concatenate(scans)[:, 2]
unit = recording.noise_unit(raw, raw.min())  # of all plots, most of which are false
print("unit of the noise", unit)
tau = raw.min() / unit.value
scans = [z / [1, 1, unit.value] for z in scans]
F, Q = page.motion.cv(1.0), page.motion.white_acceleration(1.0, 0.01)
law = page.averaged([5.0, 15.0, 45.0], tau)  # three levels, since the target's is not known
P = np.diag([400.0, 1, 400, 1])
setup = page.Setup(x, P, F, Q, 10.0, 0.1, p_detect=0.9, law=law)
result = page.run(scans, setup, method="LM-AI")
print("existence", result.existence[-1])
control = [
    z[np.hypot(*(z[:, :2] - at[::2]).T) > 40] for z, at in zip(scans, result.x[:, 0], strict=True)
]
print("without the target", page.run(control, setup, method="LM-AI").existence[-1])
plt.plot(result.existence)
plt.xlabel("scan")
plt.ylabel("existence")
plt.savefig("build/amplitudes.png")
