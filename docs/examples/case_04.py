import matplotlib.pyplot as plt
import numpy as np

import tbdcore

page = tbdcore.page("track_cfar")
rows, true = (np.loadtxt(f"build/plots{end}.csv", delimiter=",") for end in ("", "_true"))
rows[:, 2] = np.radians(rows[:, 2])
rows[:, 3] /= np.median(rows[:, 3] - 6.0) / np.log(2)  # noise: excess over the threshold of 6
t, first = np.unique(rows[:, 0], return_index=True)
scans, T = np.split(rows[:, 1:], first[1:]), np.diff(t)
p = page.Scenario(scan=4.0, bandwidth=5.0, beamwidth=1.5, sigma_p=1.0)
tracks = page.run(scans, p, accuracy=(10.0, 0.002), T=T)
cut = [z[np.arange(len(z)) != track.plot] for z, track in zip(scans[12:], tracks[10:], strict=True)]
control = page.run(cut, p, accuracy=(10.0, 0.002), start=tracks[9], T=T[11:])
print(len(tracks), "scans; ends", len(control), "scans after the target is cut out")
fig, (above, below) = plt.subplots(2, sharex=True, layout="constrained")
for k, track in enumerate(tracks, start=2):
    error = np.hypot(*track.x[::2]) - true[k, 1]
    above.errorbar(t[k], error, track.half[0], fmt=".", color="C0" if track.plot >= 0 else "C3")
above.axhline(0.0, color="c", lw=4, label="truth")
above.set_ylabel("range error and gate (m)")
above.legend()
below.plot(t[2 : 2 + len(tracks)], [track.eta for track in tracks])
below.set(xlabel="time (s)", ylabel="threshold (noise powers)")
plt.savefig("build/case_04.png")
