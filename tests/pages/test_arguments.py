"""One contract for the functions that users call on every page, and for the fields of its classes.

Each argument of a valid call is replaced by bad ones of its kind; SPECIAL has those that only one
page can know.  Each is a ValueError of one line that begins with the name of what is wrong.
"""

import dataclasses
import inspect
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore import recording
from tbdcore.recording import misfit

DP, MM, MDA, CFAR, AI = map(
    tbdcore.page, ("dp_tbd", "mm_pf_tbd", "mda_tbd", "track_cfar", "ljipda_ai")
)


def rng(seed=55):
    return np.random.default_rng(seed)


# Valid calls -----------------------------------------------------------------------------------

DP_P = DP.Scenario(K=5, grid=(9, 14), M=2)
DP_Z = rng(50).standard_normal((9, 9, 14))
SEARCHES = rng(51).standard_normal((30, 9, 9, 14))
MM_P = MM.Scenario(M=50, M_new=50)
MM_Z = MM.simulate(MM.Scene(frames=5), rng(50))
MM_LONG = MM.simulate(MM.Scene(frames=8), rng(50))
MM_STATE = MM.start(MM_P, rng(1))
GRID = {"nr": 24, "na": 14, "dr": 4.0, "da": 0.02, "r_min": 800.0, "sd_r": 1.2, "sd_a": 1.4}
MDA_P = MDA.scenario(**GRID, N=30, B=20, window=3, noise=40.0)
MDA_Z = 40.0 * rng(50).standard_exponential((5, 24, 14))
MDA_STATE = MDA.start(MDA_P, rng(1))
CFAR_P = CFAR.Scenario(scan=4.0, bandwidth=5.0, beamwidth=1.5, sigma_p=1.0)
PAIR = (10.0, 0.002)  # accuracies in m and rad
X4, P4 = np.array([20e3, -120.0, 9e3, 90.0]), np.diag([100.0, 1.0, 100.0, 1.0])
AI_X = np.array([[-400.0, 6.0, 2920.0, 1.5], [-400.0, 6.0, 3080.0, -1.5]])
F, Q = AI.motion.cv(2.0), AI.motion.step_acceleration(2.0, 0.05)
SETUP = AI.Setup(AI_X, np.diag([400.0, 9, 400, 9]), F, Q, 8.0, 0.15, 0.9, 1e-5, snr=30.0, tau=2.8)
AI_SCANS = [np.c_[AI_X[:, ::2] + 2 * k * AI_X[:, 1::2], [9.0, 9.0]] for k in range(6)]
AI_STATE = AI.start(SETUP)


def plots(columns=3):
    """Six scans of the target that X4 starts, with two plots from the third on."""
    place = X4[::2] + np.outer(4.0 * np.arange(1, 7), X4[1::2])
    rows = np.column_stack([np.hypot(*place.T), np.arctan2(*place.T[::-1]), np.full(6, 30.0)])
    rows = np.column_stack([rows, np.full(6, 10.0), np.full(6, 0.002)])[:, :columns]
    return [rows[k : k + 1][[0] if k < 2 else [0, 0]] for k in range(6)]


TRACK = CFAR.start(CFAR_P, plots(), accuracy=PAIR)
CALLS = {
    DP.start: lambda: {"p": DP_P},
    DP.step: lambda: {"state": DP.start(DP_P), "frame": DP_Z[0], "p": DP_P, "V_T": 20.0},
    DP.run: lambda: {"frames": DP_Z, "p": DP_P, "V_T": 20.0},
    DP.detect: lambda: {"z": DP_Z[:5], "p": DP_P, "V_T": 20.0},
    DP.noise_maxima: lambda: {"searches": SEARCHES, "p": DP_P},
    DP.best_tracks: lambda: {"z": DP_Z[:5], "p": DP_P},
    MM.start: lambda: {"p": MM_P, "rng": rng()},
    MM.step: lambda: {"state": MM_STATE, "frame": MM_Z[0], "p": MM_P, "rng": rng()},
    MM.run: lambda: {"frames": MM_Z, "p": MM_P, "rng": rng()},
    MM.bernoulli: lambda: {"frames": MM_Z, "p": MM_P, "rng": rng()},
    MDA.start: lambda: {"p": MDA_P, "rng": rng()},
    MDA.step: lambda: {"state": MDA_STATE, "frame": MDA_Z[0], "p": MDA_P, "rng": rng()},
    MDA.run: lambda: {"frames": MDA_Z, "p": MDA_P, "rng": rng()},
    CFAR.start: lambda: {"p": CFAR_P, "scans": plots(), "accuracy": PAIR},
    CFAR.step: lambda: {"track": TRACK, "scan": plots()[2], "p": CFAR_P},
    CFAR.run: lambda: {"scans": plots(), "p": CFAR_P, "accuracy": PAIR},
    AI.start: lambda: {"p": SETUP},
    AI.step: lambda: {"state": AI_STATE, "scan": AI_SCANS[1], "s": SETUP, "method": "LM-AI"},
    AI.run: lambda: {"scans": AI_SCANS, "p": SETUP, "method": "LM-AI"},
}
CLASSES = [
    (DP.Scenario, {}),
    (MM.Scenario, {}),
    (MM.Scene, {}),
    (MM.Prior, {}),
    (MDA.Scene, {}),
    (MDA.Filter, {}),
    (CFAR.Scenario, {}),
    (AI.Scenario, {}),
    (AI.Setup, {field.name: getattr(SETUP, field.name) for field in dataclasses.fields(SETUP)}),
]
SAID = {"z": "frames", "s": "setup", "track": "start"}  # what an argument is called in messages


# Bad arguments by their kind -------------------------------------------------------------------


def spoiled(z, value, at=(3, 4, 5)):
    z = z.copy()
    z[at] = value
    return z


def bad_frames(z):
    return {
        "transposed": z.transpose(0, 2, 1),
        "cut": z[:, :-1],
        "one frame": z[0],
        "none": z[:0],
        "nothing": None,
        "a number": 5,
        "a word": "frames",
        "words": z.astype(str),
        "a generator": (frame for frame in z),
        "complex": 1j * z,
        "truth values": z > 1,
        "ragged": [z[0], z[1][:5], z[2]],
        "infinite": spoiled(z, np.inf),
        "masked": np.ma.masked_greater(z, 1.0),
        "masked in a list": [np.ma.masked_greater(frame, 1.0) for frame in z],
    }


def bad_frame(z):
    frames = bad_frames(z)
    each = ("transposed", "cut", "words", "complex", "truth values", "infinite", "masked")
    return {kind: frames[kind][3] for kind in each} | {"several": z, "a word": "frame"}


def bad_scans(scans):
    return {
        "nothing": None,
        "a number": 5,
        "none": [],
        "one": scans[:1],
        "rows alone": [scan[0] for scan in scans],
        "too few columns": [scan[:, :1] for scan in scans],
        "complex": [scan + 1j for scan in scans],
        "words": [scan.astype(str) for scan in scans],
        "ragged": [scans[0], [[1.0, 2, 3], [4.0]], *scans[2:]],
        "masked": [*scans[:3], np.ma.masked_less(scans[3], 1e9)],
        "NaN": [*scans[:3], spoiled(scans[3], np.nan, (1, 0))],
    }


def bad_scan(scans):
    scan = scans[2]
    kinds = {"a word": "far", "complex": scan + 1j, "a row": scan[0], "ragged": [[1.0, 2], [3]]}
    return kinds | {"NaN": spoiled(scan, np.nan, (1, 0)), "masked": np.ma.masked_less(scan, 1e9)}


FRAMES = {DP: DP_Z, MM: MM_Z, MDA: MDA_Z}
SCANS = {CFAR: plots(), AI: AI_SCANS}
NUMBER = {"NaN": math.nan, "a word": "20", "several": [20.0, 20.0, 20.0]}
TIME = NUMBER | {"zero": 0.0}
KINDS = {  # by the name of the argument; `page` has what it takes
    "frames": lambda page: bad_frames(FRAMES[page]),
    "z": lambda page: bad_frames(FRAMES[page]),
    "frame": lambda page: bad_frame(FRAMES[page]),
    "searches": lambda page: {"one search": SEARCHES[0], "none": [], "a number": 30},
    "scans": lambda page: bad_scans(SCANS[page]),
    "scan": lambda page: bad_scan(SCANS[page]),
    "p": lambda page: {"nothing": None, "a number": 5, "a dict": {"K": 5}},
    "s": lambda page: {"nothing": None, "a number": 5, "a dict": {"K": 5}},
    "rng": lambda page: {"nothing": None, "a seed": 1, "an old one": np.random.RandomState(1)},
    "state": lambda page: {"nothing": None, "a number": 5, "an array": np.zeros((4, 9))},
    "track": lambda page: {"nothing": None, "a number": 5, "an array": np.zeros((4, 9))},
    "V_T": lambda page: NUMBER | {"nothing": None},
    "T": lambda page: TIME,
    "most": lambda page: {"zero": 0, "a fraction": 2.5, "a word": "all", "many": 10**9},
    "algorithm": lambda page: {"nothing": None, "a word": "tonissen", "a number": 5},
    "likelihood": lambda page: {"nothing": None, "a word": "normal", "a number": 3.0},
    "threshold": lambda page: {"a number": 3.0, "negative": lambda P_f: -1.0},
    "p_cell": lambda page: {"zero": 0.0, "above one": 1.5, "a word": "small"},
    "method": lambda page: {"unknown": "foo", "a list": ["JIPDA"], "nothing": None},
    "accuracy": lambda page: {"negative": -1, "a word": "good", "many": np.ones((3, 3))},
    "F": lambda page: {"small": np.eye(3), "a word": "fast"},
    "Q": lambda page: {"small": np.eye(3), "a word": "fast"},
}
PAGES = {
    getattr(page, function.__name__): page
    for page in (DP, MM, MDA, CFAR, AI)
    for function in CALLS
    if getattr(page, function.__name__, None) is function
}


def kinds(function, argument):
    """Bad values of an argument by their kind; None is good where it is the default."""
    bad = KINDS[argument](PAGES[function]) if argument in KINDS else {}
    optional = inspect.signature(function).parameters[argument].default is None
    return {kind: it for kind, it in bad.items() if it is not None or not optional}


CASES = [
    (function, argument, kind)
    for function in CALLS
    for argument in inspect.signature(function).parameters
    for kind in kinds(function, argument)
]


def name_of(function):
    return f"{PAGES[function].__name__.removeprefix('tbdcore_page_')}.{function.__name__}"


def refusal(function, arguments):
    """What a call says that must be refused in one line."""
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        function(**arguments)
    text = str(refused.value)
    assert len(text.splitlines()) == 1
    assert len(text) < 250
    return text


def begins(text, name):
    """Whether a message begins with a name, which a class or a list may be in front of."""
    return re.match(rf"(\w+\.|[\w.]+: )?{name}\b", text)


@pytest.mark.parametrize(
    ("function", "argument", "kind"),
    CASES,
    ids=[f"{name_of(f)}-{a}-{k}" for f, a, k in CASES],
)
def test_a_bad_argument_is_refused_by_its_name(function, argument, kind):
    bad = kinds(function, argument)[kind]
    text = refusal(function, CALLS[function]() | {argument: bad})
    said = "setup" if (PAGES[function], argument) == (AI, "p") else argument
    assert begins(text, SAID.get(argument, said)), text


@pytest.mark.parametrize("function", CALLS, ids=name_of)
def test_the_calls_that_are_spoiled_are_valid(function):
    function(**CALLS[function]())


def test_every_function_of_the_protocol_has_a_valid_call():
    for page in (DP, MM, MDA, CFAR, AI):
        names = {"start", "step", "run", "detect", "noise_maxima", "best_tracks", "bernoulli"}
        protocol = names & {*vars(page)}
        assert {function.__name__ for function in CALLS if PAGES[function] is page} == protocol
        for function in (it for it in CALLS if PAGES[it] is page):
            assert {*inspect.signature(function).parameters} <= {*KINDS, "start", "like"}


# Fields ----------------------------------------------------------------------------------------


def bad_values(field, value):
    """Values that a field does not take, by its limits, its choices and the kind of a good one."""
    about = field.metadata
    if isinstance(value, bool):
        return ["yes"]
    if isinstance(value, str):
        return ["no such", 5j]
    if not isinstance(value, int | float):
        return ["here", math.nan]
    beyond = [
        limit + side * (1 + abs(limit))
        for side, limit in ((-1, about["low"]), (1, about["high"]))
        if limit is not None and math.isfinite(limit)
    ]
    whole = [True, 2.5] if isinstance(value, int) and field.type in (int, "int") else []
    several = [] if "ndarray" in str(field.type) else [[value]]
    nothing = [] if field.default is None else [None]
    return ["20", math.nan, 1j, *nothing, *several, *beyond, *whole]


FIELDS = [
    (kind, given, field, bad)
    for kind, given in CLASSES
    for field in dataclasses.fields(kind)
    if "choices" in field.metadata
    for bad in bad_values(field, given.get(field.name, field.default))
]


@pytest.mark.parametrize(
    ("kind", "given", "field", "bad"),
    FIELDS,
    ids=[f"{kind.__module__}.{kind.__name__}.{field.name}-{bad}" for kind, _, field, bad in FIELDS],
)
def test_a_bad_field_is_refused_by_its_name(kind, given, field, bad):
    text = refusal(kind, given | {field.name: bad})
    assert begins(text, field.name) or begins(text, kind.__name__), text
    assert field.name in text


# What only one page can know -------------------------------------------------------------------


def plot(value, column=0, columns=3):
    """Scans of plots with one value changed in plot 1 of scan 4."""
    scans = plots(columns)
    scans[4][1, column] = value
    return scans


def ratios(f):
    return {"likelihood": lambda frame, r, S, p: f(r)}


def amplitude(value):
    return {"scans": [*AI_SCANS[:3], spoiled(AI_SCANS[3], value, (1, 2)), *AI_SCANS[4:]]}


def told(**change):
    return {"p": replace(SETUP, **change)}


CHAIN = (0.9, 0.05, 0.05), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)
SWAP = [0, 2, 1, 3]  # x, y, vx, vy
NO_NUMBER = math.nan, "five", None, [1.0, 2.0, 3.0]
SPECIAL = {
    DP.run: [
        ({"frames": DP_Z[:4]}, "frames"),
        ({"frames": [None] * 9}, "frames"),
        ({"p": replace(DP_P, K=10)}, "frames"),
        ({"state": DP.run(DP_Z, DP_P, 99.0)}, "state"),
        ({"algorithm": DP.penalised}, "algorithm"),
    ],
    DP.detect: [
        *[({"z": z}, "frames") for z in (DP_Z, DP_Z[:4])],
        ({"most": 127}, "most"),
        ({"V_T": recording.threshold(np.arange(40.0), 0.1)}, "V_T"),
        *[({"V_T": bad}, "V_T") for bad in (True, np.True_)],
    ],
    DP.step: [
        ({"state": DP.State(DP_Z)}, "state"),
        ({"state": DP.State(DP_Z[:3, :, :9])}, "state"),
        ({"state": DP.State(spoiled(DP_Z, np.inf)[:4])}, "state"),
    ],
    DP.noise_maxima: [
        ({"searches": SEARCHES[:, :4]}, "searches"),
        ({"searches": SEARCHES[:1]}, "searches"),
        ({"searches": np.ones((30, 5, 9, 14))}, "searches"),
        ({"searches": 1j * SEARCHES}, "searches"),
        ({"searches": lambda rng: SEARCHES[0]}, "searches"),
        ({"like": DP_Z[:5]}, "searches"),
        ({"like": DP_Z.T}, "like"),
    ],
    DP.penalised: [({"price": bad}, "price") for bad in (-0.5, math.nan, "0.5", [0.5])],
    DP.Scenario: [
        ({"slack_pos": 2}, "slack_pos"),
        ({"grid": (50, 6)}, "grid"),
        ({"grid": (50, 50, 50)}, "grid"),
        ({"snr_db": (3, 5, 4)}, "snr_db"),
        ({"snr_db": ()}, "snr_db"),
        ({"turn_rates": (0.2, 0.2)}, "turn_rates"),
        ({"grid": (10**6, 10**6)}, "grid"),
        ({"v0": (200, 150)}, "v0"),
        ({"x0": (351.6, 351.5)}, "x0"),
        ({"y0": (350.4, 350.3)}, "y0"),
        ({"region": (355, 350)}, "region"),
        ({"x0": (349, 349.1)}, "x0"),
        ({"y0": (354.9, 355.1)}, "y0"),
    ],
    DP.best_tracks: [({"z": DP_Z[:4]}, "frames")],
    MM.run: [
        ({"frames": MM_Z[:2]}, "frames"),
        ({"frames": MM_Z + 100.0}, "frames"),
        ({"frames": np.round(100 + 20 * MM_Z)}, "frames"),
        ({"frames": MM_Z * 10.0}, "frames"),
        ({"frames": MM_Z / 30.0}, "frames"),
        ({"frames": spoiled(MM_Z, 0.0, 2)}, "frames"),
        ({"frames": np.repeat(MM_Z[:3], 2, axis=0)}, "frames"),
        ({"T": [1.0, 1.0, np.nan, 1.0, 1.0]}, "T"),
        ({"T": [1000.0] * 5}, "T"),  # milliseconds
        ({"frames": MM_LONG, "T": np.arange(1.0, 9.0)}, "T"),  # time stamps
        ({"p": replace(MM_P, M=60), "state": MM_STATE}, "state"),
        (ratios(lambda r: None), "likelihood"),
        (ratios(lambda r: 1.0), "likelihood"),
        (ratios(lambda r: np.zeros(r.size + 1)), "likelihood"),
        (ratios(lambda r: np.where(r > 0, np.nan, 0.0)), "likelihood"),
        (ratios(lambda r: np.zeros(r.size, complex)), "likelihood"),
        (ratios(lambda r: np.ones(r.size)), "likelihood"),
    ],
    MM.step: [
        ({"state": MM_STATE._replace(**change)}, "state")
        for change in (
            {"r": MM_STATE.r + 3},
            {"r": MM_STATE.r[:10]},
            {"S": MM_STATE.S[:, :4]},
            {"S": MM_STATE.S * np.nan},
            {"S": MM_STATE.S + 1e4},
            {"S": MM_STATE.S + [1e4, 0, 0, 0, 0]},  # far in x alone
            {"S": MM_STATE.S + [0, 0, 1e4, 0, 0]},
            {"absence": (1.5,)},
            {"absence": 0.9},
            {"s": np.zeros(4)},
        )
    ],
    MM.bernoulli: [
        ({"p": replace(MM_P, prior=MM.Prior(absent=1.0, cv=0.0, ct=0.0))}, "prior"),
        ({"p": replace(MM_P, prior=MM.Prior(Pi=((1, 0, 0), *CHAIN[1:])))}, "prior"),
        ({"p": replace(MM_P, prior=MM.Prior(Pi=(*CHAIN[:2], (1, 0, 0))))}, "prior"),
        ({"p": replace(MM_P, M_new=0)}, "p"),
    ],
    MM.Scenario: [
        ({"scene": MM.Scene(nx=64, ny=48), "prior": MM.Prior()}, "prior"),
        ({"prior": MM.Prior(y=(5, 25))}, "prior"),
        ({"scene": 3}, "scene"),
        ({"M": 10**12}, "M"),
    ],
    MM.Prior: [
        ({"Pi": (CHAIN[0], (0.1, 0.8, 0.2), CHAIN[2])}, "Pi"),
        ({"Pi": ((0.9, 0.1), (0.1, 0.9))}, "Pi"),
        ({"Pi": ((1.9, -0.9, 0.0), *CHAIN[1:])}, "Pi"),
        ({"absent": 0.8}, "prior"),
        ({"vx": (2, -2)}, "prior"),
    ],
    MM.Scene: [
        ({"blur": 1.3}, "blur"),
        ({"amplitude": 1e9}, "amplitude"),
        ({"frames": 10**12}, "frames"),
        ({"legs": ((7, 21),)}, "legs"),
    ],
    MM.start: [({"p": MM.Scene(), "rng": rng()}, "p")],
    MM.path: [({"s": bad}, "s") for bad in (None, 3, MM_P)],
    MM.simulate: [
        ({"s": MM.Scene(x=31.0), "rng": rng()}, "scene"),
        ({"s": MM.Scene(speed=2.0), "rng": rng()}, "scene"),
        ({"s": 3, "rng": rng()}, "s"),
        ({"s": MM.Scene(), "rng": 1}, "rng"),
        ({"s": MM.Scene(), "rng": rng(), "fade": [1.0, 0.5]}, "fade"),
        ({"s": MM.Scene(), "rng": rng(), "fade": np.nan}, "fade"),
    ],
    MDA.run: [
        ({"frames": MDA_Z[:2]}, "frames"),
        ({"frames": -MDA_Z}, "frames"),
        ({"frames": MDA_Z + 1e4}, "frames"),
        ({"frames": MDA_Z / 40.0}, "frames"),
        ({"frames": np.sqrt(MDA_Z)}, "frames"),
        ({"frames": np.maximum(10 * np.log10(MDA_Z) - 20, 0)}, "frames"),
        ({"frames": spoiled(MDA_Z, 1e5), "p": replace(MDA_P, source="state")}, "frames"),
        ({"frames": spoiled(MDA_Z, np.nan), "p": replace(MDA_P, likelihood="coherent")}, "frames"),
        ({"T": [1.0, 1.0, np.nan, 1.0, 1.0]}, "T"),
        ({"frames": [*MDA_Z, *MDA_Z], "T": np.arange(1.0, 11.0)}, "T"),
        ({"p": replace(MDA_P, N=31), "state": MDA_STATE}, "state"),
    ],
    MDA.step: [
        ({"frame": 10 * np.log10(MDA_Z[0])}, "frame"),
        ({"frame": MDA_Z[0] / 40.0}, "frame"),
        ({"frame": np.zeros((24, 14))}, "frame"),
        ({"p": MDA.Filter(N=30, B=20)}, "frame"),
        ({"p": replace(MDA_P, window=5)}, "state"),
        *(
            ({"state": MDA_STATE._replace(**change)}, "state")
            for change in (
                {"memory": None},
                {"S": MDA_STATE.S[:, :9]},
                {"S": MDA_STATE.S * np.nan},
                {"S": MDA_STATE.S / 1000},
                {"S": MDA_STATE.S[[2, 3, 0, 1]]},
                {"existence": 1.5},
                {"k": -1},
            )
        ),
    ],
    MDA.scenario: [
        *((GRID | {name: bad}, name) for name in (*GRID, "noise") for bad in NO_NUMBER),
        (GRID | {"birth_sped": 3.0}, "scenario"),
        (GRID | {"source": "known"}, "scenario"),
        (GRID | {"sd_r": 0.0}, "sd_r"),
        (GRID | {"nr": 24.5}, "nr"),
        (GRID | {"a_min": "north"}, "a_min"),
        (GRID | {"da": 1.0}, "azimuth"),
        (GRID | {"sd_r": 0.1, "sd_a": 0.1}, "Filter"),
        (GRID | {"r_max": 900.0}, "scenario"),
        (GRID | {"scans": 9}, "scenario"),
    ],
    MDA.target: [({"scene": None}, "scene"), ({"scene": MDA_P}, "scene")],
    MDA.simulate: [
        ({"scene": MDA_P, "truth": rng(), "noise": rng()}, "scene"),
        ({"scene": MDA.Scene(), "truth": rng(), "noise": None}, "noise"),
        ({"scene": MDA.Scene(), "truth": 7, "noise": rng()}, "truth"),
    ],
    MDA.Scene: [({"appears": 20, "leaves": 19}, "leaves"), ({"dr": 3.0}, "range")],
    MDA.Filter: [
        ({"a_max": 46.0, "da": 0.1, "a_min": 45.0, "L_a": 100.0}, "azimuth"),
        ({"L_r": 36.0, "L_a": 14600.0}, "Filter"),
        ({"dr": 3.0}, "range"),
        ({"N": 10**8, "B": 10**8}, "N"),
        ({"window": 10**7}, "N"),
    ],
    CFAR.run: [
        ({"scans": np.zeros((5, 3))}, "scans"),
        ({"scans": plots()[2:]}, "scans"),
        ({"scans": [[], *plots()]}, "scans"),
        ({"scans": [*plots()[:4], np.ones((2, 4))]}, "scans"),
        *(({"scans": plot(bad)}, "scans") for bad in (-5.0, math.inf)),
        ({"scans": [cells * [1e-3, 1, 1] for cells in plots()]}, "scans"),  # kilometres
        *(({"scans": plot(bad, 1)}, "scans") for bad in (24.0, 9.4, -math.inf)),  # degrees
        ({"scans": plot(-3.0, 2)}, "scans"),  # decibels
        ({"scans": plot(math.nan, 2)}, "scans"),
        ({"scans": plot(0.0, 3, 5)}, "scans"),
        ({"scans": plot(2.0, 4, 5)}, "scans"),
        *(
            ({"accuracy": bad}, "accuracy")
            for bad in (
                (10.0, 2.0),
                (1e7, 0.002),
                (10.0, 0.1j),
                lambda: PAIR,
                lambda r: np.full(3, 0.002),
                lambda r: (math.nan, 1.0),
                np.ma.masked_less([1.0, 1.0], 2.0),
            )
        ),
        *(
            ({"threshold": bad}, "threshold")
            for bad in (lambda: 5.0, lambda P_f: math.nan, lambda P_f: [5.0, 6.0], lambda P_f: "5")
        ),
        ({"T": [4.0] * 6}, "T"),
        ({"T": [4.0, 4.0, math.nan, 4.0, 4.0]}, "T"),
        *(
            ({"start": bad}, "start")
            for bad in (
                5,
                (X4,),
                (X4[:3], P4),
                (X4 * math.nan, P4),
                (X4, -P4),
                (X4, 0 * P4),
                (X4[SWAP], P4[SWAP][:, SWAP]),
                CFAR.Track(X4, P4, 3),
            )
        ),
        ({"p": replace(CFAR_P, scan=np.ones(2))}, "scan"),
    ],
    CFAR.step: [({"scan": [[20.0, 0.4, 5.0]]}, "scan")],
    CFAR.Scenario: [({"bandwidth": 5e6}, "bandwidth"), ({"track_pfa": 1.0}, "track_pfa")],
    AI.Setup: [
        *(({name: bad}, name) for name in "xPFQ" for bad in NO_NUMBER),
        *(({"P": bad}, "P") for bad in (np.zeros((4, 4)), np.eye(4) + np.eye(4, k=1), np.eye(2))),
        ({"P": [np.eye(4), -np.eye(4)]}, "P"),
        ({"Q": -np.eye(4)}, "Q"),
        ({"F": np.eye(3)}, "F"),
        *(({"x": bad}, "x") for bad in (AI_X[0], [[0.0, 0, 1]], np.empty((0, 4)), AI_X + 1j)),
        ({"x": np.ma.masked_less(AI_X, 0)}, "x"),
        ({"p_detect": [0.9, 0.9, 0.9]}, "p_detect"),
        ({"clutter": "estimated"}, "clutter"),
        ({"clutter": 1e9}, "clutter"),
        ({"law": 3.0}, "law"),
    ],
    AI.run: [
        *((amplitude(bad), "scans") for bad in (math.inf, 2.7, 1e6, -9.0)),
        ({"scans": [scan[:, :2] for scan in AI_SCANS]}, "scans"),  # no amplitudes
        ({"scans": [scan.T for scan in AI_SCANS]}, "scans"),
        ({"scans": [], "state": AI_STATE}, "scans"),
        (told(gamma=9.0), "p_gate"),
        (told(x=np.zeros((2, 4))), "x"),
        (told(tau=None), "tau"),
        (told(snr=None), "snr"),
        (told(F=np.tile(F, (6, 1, 1))), "F"),
        (told(law=lambda a: a[:-1], snr=None), "law"),
        (told(law=lambda a: a * math.nan, snr=None), "law"),
        (told(x=np.tile(AI_X[:1], (17, 1))) | {"method": "JIPDA-AI"}, "x"),
        ({"accuracy": [(8.0, 0.0)] * 6}, "accuracy"),
        ({"p": AI.Scenario()}, "rng"),
    ],
    AI.step: [
        ({"state": AI_STATE._replace(**change)}, "state")
        for change in (
            {"x": AI_X[:1]},
            {"existence": np.array([0.5, 1.5])},
            {"P": -AI_STATE.P},
            {"k": 1.5},
        )
    ],
    AI.Scenario: [({"frames": 60}, "frames"), ({"frames": 1, "scenario": "print"}, "frames")],
    AI.simulate: [({"p": AI.Scenario(clutter=1e-2, sigma_r=1e3), "rng": rng(8)}, "simulate")],
}
ODD = [(function, change, name) for function, cases in SPECIAL.items() for change, name in cases]


@pytest.mark.parametrize("number", range(len(ODD)))
def test_what_one_page_knows_is_refused_by_its_name(number):
    function, change, name = ODD[number]
    good = CALLS[function]() if function in CALLS else dict(next(
        (given for kind, given in CLASSES if kind is function), {}))  # fmt: skip
    text = refusal(function, good | change)
    assert begins(text, name), text


# Noise and plots that are not what was told ---------------------------------------------------

WRONG = {  # told wrong, in silence until now: frames of unit noise -> what is named first
    "mean": lambda z: z + 0.4,
    "level": lambda z: 3.0 * z,
    "slope": lambda z: z + np.linspace(-0.5, 0.5, 32)[:, None],
    "neighbours": lambda z: (z[:, 1:-1] + 0.5 * z[:, :-2] + 0.5 * z[:, 2:]) / 1.5**0.5,
    "tails": lambda z: np.sign(z) * (np.exp(abs(z)) - 1) / 2.3,
}


@pytest.mark.parametrize("what", WRONG)
def test_noise_that_is_not_what_was_told_gives_one_warning(what):
    z = WRONG[what](np.random.default_rng(60).standard_normal((60, 32, 20)))
    p = MM.Scenario(M=50, M_new=50, scene=MM.Scene(nx=z.shape[1], ny=20, noise=1.0))
    words = {"mean": "level", "level": "spread", "neighbours": "next", "tails": "tail"}
    with pytest.warns(misfit.Misfit, match=f"{words.get(what, what)}.* of the noise is") as said:
        MM.run(z, p, rng())
    assert len(said) == 1
    assert said[0].filename == __file__
    MM.step(MM.start(p, rng()), z[0], p, rng())  # a warning would be an error


@pytest.mark.parametrize("size", [(10, 10), (64, 40)])
def test_noise_is_refused_beyond_eight_times_and_four_deviations(size):
    """Spread by quartiles, of every third cell of a long side; below 100 cells nothing is said."""
    z = np.random.default_rng(61).standard_normal(size)
    few = z[:: size[0] // 32 + 1, :: size[1] // 32 + 1]
    low, middle, high = np.quantile(few, (0.25, 0.5, 0.75))
    z = (z - middle) / ((high - low) / 1.349)
    p = MM.Scenario(M=9, M_new=0, scene=MM.Scene(nx=size[0], ny=size[1], noise=1.0))
    for good in (0.2 * z, 0.9 * z, 7.9 * z, z + 3.9, z - 3.9):
        MM.step(MM.start(p, rng()), good, p, rng())
    for wrong in (0.1 * z, 8.1 * z, z + 4.1, z - 4.1):
        with pytest.raises(ValueError, match="^frame: its median is"):
            MM.step(MM.start(p, rng()), wrong, p, rng())
    thin = MM.Scenario(M=9, M_new=0, scene=MM.Scene(nx=11, ny=9, noise=1.0))
    MM.step(MM.start(thin, rng()), 9 + np.zeros((11, 9)), thin, rng())  # too few to say


def test_the_time_between_frames_ends_at_its_limits():
    for T in (1e-6, 1e6):
        MM.step(MM_STATE, MM_Z[0], MM_P, rng(), T)
    for T in (0.9999999e-6, 1.0000001e6):
        with pytest.raises(ValueError, match="^T: .* is no number in"):
            MM.step(MM_STATE, MM_Z[0], MM_P, rng(), T)


@pytest.mark.parametrize(
    "Pi",
    [
        ((0.9, 0.1, 0.0), (0.1, 0.9, 0.0), (0.1, 0.9, 0.0)),  # nothing turns
        ((0.9, 0.0, 0.1), (0.1, 0.0, 0.9), (0.1, 0.0, 0.9)),  # nothing flies straight
        ((0.0, 0.5, 0.5), (0.0, 0.5, 0.5), (0.0, 0.5, 0.5)),  # a target is always there
    ],
)
def test_a_regime_that_no_row_reaches_is_never_said(Pi):
    p = replace(MM_P, M=400, prior=MM.Prior(Pi=Pi))
    empty = np.flatnonzero(~np.any(Pi, axis=0))
    for filtered in (MM.run, MM.bernoulli):
        said = filtered(MM_Z, replace(p, M_new=0 if filtered is MM.run else 50), rng())
        shares = np.array([1 - said.existence, said.existence * (1 - said.turning), said.turning])
        assert np.isfinite(said.existence).all()
        assert (np.nan_to_num(shares)[empty, 1:] < 1e-9).all()


def test_columns_in_another_order_are_named():
    """[amplitude, x, y] and [y, x, amplitude]: no plot lies in a gate."""
    for order in ([2, 0, 1], [1, 0, 2]):
        odd = [scan[:, order] for scan in AI_SCANS for _ in range(3)]
        words = r"^scans: no plot of 17 scans lies in a gate"
        with pytest.warns(misfit.Misfit, match=words):
            AI.run(odd, replace(SETUP, tau=0.0), method="LM-AI")


def test_sixteen_tracks_are_the_limit_of_exact_association_only():
    many = replace(SETUP, x=np.tile(AI_X[:1], (17, 1)))
    for method in set(AI.METHODS) - {"JIPDA", "JIPDA-AI"}:
        assert np.isfinite(AI.states(AI_SCANS[:3], many, method)[0]).all()
    for method in ("JIPDA", "JIPDA-AI"):
        with pytest.raises(ValueError, match="^x: over 16 tracks share plots"):
            AI.run(AI_SCANS[:3], many, method=method)
