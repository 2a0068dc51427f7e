from pathlib import Path

import matplotlib.image
import numpy as np
from scipy.io import loadmat

from tbdcore import recording

frames = np.load("build/a.npz")["frames"]  # .npz; for .npy leave out ["frames"]
frames = frames.astype(float)
frames = loadmat("build/a.mat")["frames"]  # .mat: often (nx, ny, K)
frames = frames.transpose(2, 0, 1)
samples = np.load("build/a.npy")  # complex samples
power = abs(samples) ** 2

files = sorted(Path("build/images").glob("*.png"), key=lambda f: (len(f.name), f.name))  # 2 < 10
images = np.array([matplotlib.image.imread(file) for file in files], float)
images = images if images.ndim == 3 else images[..., :3].mean(axis=-1)  # colours: their mean

rows = np.loadtxt("build/a.csv", delimiter=",", skiprows=1, dtype=str)  # date or s, place, ...
t, scans = recording.scans(rows)  # with the times of all scans: recording.scans(rows, times)
turn = 10.0  # s: plots that come one at a time, as of AIS or a turning antenna, are one scan a turn
late = np.repeat(turn * np.floor(t / turn), [len(scan) for scan in scans])
turns, scans_of_turns = recording.scans(np.c_[late, np.concatenate(scans)])

latitude, longitude = np.array([50.77, 50.78]), np.array([-1.09, -1.10])  # degrees
north = 111_195 * (latitude - latitude[0])  # m, within 100 km
east = 111_195 * (longitude - longitude[0]) * np.cos(np.radians(latitude[0]))
