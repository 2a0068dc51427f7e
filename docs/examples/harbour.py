"""Two boats in a harbour, from plots of a real radar; truth from their satellite receivers.

Run it with the number of the scene: .venv/bin/python docs/examples/harbour.py 2 (or 17).
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import tbdcore
from tbdcore import recording

scene = int(sys.argv[1]) if len(sys.argv) > 1 else 17
file = f"data/recorded/autoferry_{scene:02d}"
rows, true = (np.genfromtxt(f"{file}{end}.csv", delimiter=",")[1:] for end in ("", "_truth"))
own = {row[0]: row[[2, 1]] - rows[0, [2, 1]] for row in rows}  # the radar moves: east, north
t, scans = recording.scans(rows[:, [0, 4, 3]])  # x east, y north
away = 10e3  # far from the radar a plot has the same error on both axes
scans = [recording.merge_plots(z + own[s] + away, 6.0) for s, z in zip(t, scans, strict=True)]

page = tbdcore.page("ljipda_ai")
sigma, fastest, q = 4.0, 5.0, 0.1  # half a boat in m, m/s, m2/s3
angle = np.degrees(sigma / (away * 2**0.5))


def setup(x, P, T=1.0):
    F, Q = page.motion.cv(T), page.motion.white_acceleration(T, q)
    return page.Setup(x, P, F, Q, sigma, angle, p_detect=0.6, p_start=0.5)


def start(x, P):
    return page.start(setup(x, P))


def step(state, scan, T):
    return page.step(state, scan, setup(state.x, state.P, T), "JIPDA")


tracks = recording.follow(scans, t, fastest, sigma, start, step).declared()

near, on = {1: [], 2: []}, set()  # distances of the nearest track where a plot is near
for s, boat, north, east in true:
    k, place = int(np.searchsorted(t, s)), own[s] + [east, north] + away
    distance = np.hypot(*(tracks.at(k)[:, ::2] - place).T)
    on |= set(tracks.track[tracks.scan == k][distance < 15].tolist())
    if np.hypot(*(scans[k] - place).T).min(initial=np.inf) < 15:
        near[int(boat)].append(distance.min(initial=np.inf))
for boat, distances in near.items():
    share = np.mean(np.array(distances) < 15)
    print(f"boat {boat}: a track within 15 m in {share:.0%} of {len(distances)} scans with a plot")
other = [tracks.x[tracks.track == n] for n in set(tracks.track.tolist()) - on]
still = sum(np.ptp(x[:, ::2], axis=0).max() < 10 for x in other)
scans_of = ", ".join(str(len(x)) for x in other)
print(f"{len(on)} tracks on the boats, {len(other)} on neither: {still} of them stay within 10 m")
print(f"those on neither last {scans_of} of {len(t)} scans")

plt.plot(*(np.concatenate(scans) - away).T, ".", color="0.8", label="plots")
for boat, colour in ((1, "c."), (2, "m.")):
    path = [own[s] + [east, north] for s, b, north, east in true if b == boat]
    plt.plot(*np.transpose(path), colour, ms=8, label=f"boat {boat}, by satellite")
for n in np.unique(tracks.track):
    plt.plot(*(tracks.x[tracks.track == n][:, ::2] - away).T, "k-" if n in on else "k:")
plt.gca().set(xlabel="east (m)", ylabel="north (m)", aspect="equal")
plt.legend()
plt.savefig(f"build/harbour_{scene}.png")
