"""Fields of scenarios: what they carry, what they take, and how they refuse the rest."""

import dataclasses
import math
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from tbdcore.scenario import ABOVE_ZERO, BELOW_ONE, check, given


@dataclass(frozen=True)
class Sensor:
    blur: float = given(0.6, r"\Sigma", "cells", low=0.1, high=0.8)
    __post_init__ = check


@dataclass(frozen=True)
class Scenario:
    K: int = given(11, "K", "frames", "s4.K", 1, 100)
    n: int = given(0, "n")
    p: float = given(0.5, "P_D", low=ABOVE_ZERO, high=BELOW_ONE)
    level: float = given(0.0, "R", "dB")
    floor: float = given(0.0, "F", "dB", low=-math.inf, high=math.nextafter(90, 0))
    square: bool = given(False, "z^2")
    metric: str = given("chebyshev", r"|\cdot|", choices=("chebyshev", "euclidean"))
    name: str = given("any", "")
    grid: tuple[int, int] = given((50, 40), r"N_x \times N_y", "cells", low=2)
    region: tuple = given((350, 355), "x, y", "km")
    rates: tuple[float, ...] = given((0, 0.2), r"\omega", "rad/s", low=0)
    chain: tuple = given(((0.9, 0.1), (0.2, 0.8)), r"\Pi", low=0, high=1)
    legs: tuple[tuple, ...] = given(((7, 21), (22, 27)), "k", "frames")
    lattice: tuple = given((), "L")
    cells: tuple[int, ...] = given((), "c")
    scale: float | np.ndarray = given(1.0, r"\kappa", low=0)
    clutter: float | str = given("estimate", r"\lambda", low=ABOVE_ZERO, choices=["estimate"])
    snr: float = given(None, "d", low=0)
    sensor: Sensor = given(Sensor(), "")
    __post_init__ = check


GOOD = [
    {"K": np.int32(100)},
    {"p": np.float32(0.25)},
    {"p": BELOW_ONE},
    {"p": ABOVE_ZERO},
    {"level": -3},
    {"floor": -math.inf},
    {"square": np.True_},
    {"metric": "euclidean"},
    {"name": "another"},
    {"grid": [2, np.int64(3)]},
    {"grid": np.array([2, 3])},
    {"region": (0.5, 30.5)},
    {"rates": (0.4,)},
    {"rates": np.arange(5)},
    {"chain": np.eye(2)},
    {"legs": ((1, 2), (3, 4), (5, 6))},
    {"lattice": ((1.0, 2.0, 3.0),)},
    {"cells": (3,)},
    {"scale": [[0.0], [2.0]]},
    {"clutter": 1e-5},
    {"snr": 10},
    {"sensor": Sensor(blur=0.8)},
]

BAD = [
    ({"K": 0}, r"0; give an integer in \[1, 100\]"),
    ({"K": 101}, "101; give"),
    ({"K": 2.0}, "2.0; give an integer"),
    ({"K": True}, "True; give an integer"),
    ({"K": 2**70}, "give an integer"),
    ({"n": np.uint64(2**63)}, "give an integer"),
    ({"K": np.array(3)}, r"array\(3\); give an integer"),
    ({"p": 0.0}, r"0.0; give a number in \(0, 1\)"),
    ({"p": 1.0}, "1.0; give"),
    ({"p": np.float32(1 - 1e-9)}, "give"),
    ({"p": math.nan}, "nan; give"),
    ({"p": True}, "True; give a number"),
    ({"p": None}, "None; give a number"),
    ({"p": "0.5"}, "'0.5'; give a number"),
    ({"p": 0.5 + 0j}, "give a number"),
    ({"p": [0.5]}, r"\[0.5\]; give a number"),
    ({"level": math.inf}, "inf; give a number that is finite"),
    ({"level": -math.inf}, "-inf; give a number that is finite"),
    ({"level": 10**400}, "give a number"),
    ({"floor": 90.0}, r"90.0; give a number in \[-inf, 90\)"),
    ({"square": 1}, "1; give True or False"),
    ({"metric": "euclid"}, "'euclid' is unknown; the nearest is 'euclidean' of chebyshev, euclid"),
    ({"metric": 3}, "3; give one of chebyshev, euclidean"),
    ({"name": 3}, "3; give a text"),
    ({"grid": (50, 1)}, r"\(50, 1\); give 2 integers in \[2, inf\)"),
    ({"grid": (50, 40, 3)}, "give 2 integers"),
    ({"grid": (50.0, 40.0)}, "give 2 integers"),
    ({"grid": 50}, "50; give 2 integers"),
    ({"region": (0, math.nan)}, "give 2 numbers"),
    ({"rates": ()}, "give numbers"),
    ({"rates": 0.2}, "0.2; give numbers"),
    ({"rates": (0.1, -0.1)}, r"give numbers in \[0, inf\)"),
    ({"rates": ((0.1, 0.2), (0.3,))}, "give numbers"),
    ({"chain": ((0.9, 0.1),)}, r"give 2 x 2 numbers in \[0, 1\]"),
    ({"chain": ((0.9, 0.1), (0.2, 1.8))}, "give 2 x 2 numbers"),
    ({"legs": (1, 2)}, "give numbers"),
    ({"legs": ((1, 2, 3),)}, "give numbers"),
    ({"cells": (0.5,)}, "give integers"),
    ({"lattice": ("a", "b")}, "give numbers"),
    ({"scale": [1.0, -1.0]}, r"give a number in \[0, inf\) or numbers in \[0, inf\)"),
    ({"scale": np.ma.masked_less([1.0, 2.0], 1.5)}, "give a number"),
    ({"clutter": "guess"}, "'guess' is unknown; the nearest is 'estimate'"),
    ({"clutter": 0.0}, r"0.0; give a number in \(0, inf\) or one of estimate"),
    ({"snr": -1}, "-1; give a number"),
    ({"sensor": 3}, "3; give a Sensor"),
    ({"sensor": None}, "None; give a Sensor"),
]


def test_a_field_carries_its_letter_its_unit_and_its_row():
    K, _, p = dataclasses.fields(Scenario)[:3]
    assert [K.metadata[key] for key in ("symbol", "unit", "row")] == ["K", "frames", "s4.K"]
    assert p.metadata["row"] == "open"
    assert Scenario().K == 11


@pytest.mark.parametrize("change", GOOD)
def test_a_value_within_the_limits_is_kept_as_it_is(change):
    ((name, value),) = change.items()
    assert getattr(Scenario(**change), name) is value


@pytest.mark.parametrize(("change", "words"), BAD)
def test_another_value_is_refused_in_one_line_that_names_class_and_field(change, words):
    (name,) = change
    with pytest.raises(ValueError, match=rf"^Scenario\.{name}: .*{words}") as error:
        Scenario(**change)
    assert "\n" not in str(error.value)


def test_a_scenario_within_a_scenario_is_checked_too():
    """Also one that does not check itself."""

    @dataclass(frozen=True)
    class Part:
        N: int = given(3, "N", low=1)

    @dataclass(frozen=True)
    class Whole:
        part: Part = given(Part(), "")
        __post_init__ = check

    with pytest.raises(ValueError, match=r"^Part\.N: 0; give an integer in \[1, inf\)$"):
        Whole(Part(N=0))


@pytest.mark.parametrize(
    "field",
    [
        lambda: given(5, "N", low=6),
        lambda: given(5, "N", high=4),
        lambda: given(math.nan, "N"),
        lambda: given("5", "N"),
    ],
)
def test_a_default_outside_its_own_limits_is_refused_whatever_is_given(field):
    @dataclass(frozen=True)
    class Odd:
        N: float = field()
        __post_init__ = check

    for value in (7.0, 5.0):
        with pytest.raises(ValueError, match=r"^Odd\.N: its default '?(5|nan)'?; give a number"):
            Odd(value)


def test_a_field_without_a_default_and_a_field_of_another_kind():
    @dataclass(frozen=True)
    class Setup:
        x: np.ndarray
        sigma: float = given(low=ABOVE_ZERO)
        __post_init__ = check

    assert Setup(x="anything", sigma=2.0).sigma == 2.0
    with pytest.raises(ValueError, match=r"^Setup\.sigma: 0; give"):
        Setup(None, 0)


def test_limits_are_inherited_and_survive_a_process():
    @dataclass(frozen=True)
    class Longer(Scenario):
        more: int = given(1, "m", low=1)

    with pytest.raises(ValueError, match=r"^Longer\.K: 0"):
        Longer(K=0)
    p = pickle.loads(pickle.dumps(Scenario(K=5)))
    with pytest.raises(ValueError, match=r"^Scenario\.K: 0"):
        dataclasses.replace(p, K=0)
