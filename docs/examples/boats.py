import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording

page = tbdcore.page("ljipda_ai")
rows, true = (np.loadtxt(f"build/boats{end}.csv", delimiter=",") for end in ("", "_true"))
t, first = np.unique(rows[:, 0], return_index=True)
plots = rows[:, [4, 3]] + rows[:, [2, 1]] + 10e3  # x east, y north; the radar moves
scans = [recording.merge_plots(z, 15.0) for z in np.split(plots, first[1:])]
sigma, fastest, q = 4.0, 5.0, 0.1  # m, m/s, m2/s3
x, P = recording.starts(scans[:3], t[:3], fastest, sigma)
F, Q = zip(
    *((page.motion.cv(T), page.motion.white_acceleration(T, q)) for T in np.diff(t[2:])),
    strict=True,
)
angle = np.degrees(sigma / (10e3 * 2**0.5))  # the same error across the line of sight
setup = page.Setup(x, P, np.array(F), np.array(Q), sigma, angle, p_detect=0.6)
result = page.run(scans[2:], setup, method="JIPDA")
there = result.existence[-10:].mean(axis=0) > 0.5  # lost is existence that stays low
cut = [
    z[abs(z[:, None] - x[:, ::2]).max(2).min(1) > 30]
    for z, x in zip(scans[2:], result.x, strict=True)
]
control = page.run(cut, setup, method="JIPDA").existence[10]  # targets cut out, after ten scans
print(there, "and, without targets,", control > 0.5)
plt.plot(*plots.T, ".", color="0.8")
plt.plot(*true[:, [2, 1]].T + 10e3, "c.", ms=8)
plt.plot(*result.x[:, there][:, :, ::2].transpose(2, 0, 1), "C1")
plt.gca().set(xlabel="east (m)", ylabel="north (m)", title="truth (cyan), tracks (orange)")
plt.savefig("build/case_05.png")
