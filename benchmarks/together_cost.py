"""CPU time of a scene for each method of page 06: ``python -m benchmarks.together_cost``.

A scene has 20 frames of 40 by 40 cells and no target; simulating it is not counted.
"""

from functools import partial

from benchmarks import timing
from benchmarks.together import label
from tbdcore import page
from tbdcore.repro import trials


def stream(kind, name=""):
    """Generators of one scene."""
    return trials.generator(1, "together", "cost" + name, 0, kind)


def main():
    """Time the methods and write the file."""
    six = page("together")
    p, (_, z) = six.Setup(), six.simulate(six.Scene(), stream("truth"), stream("noise"))
    methods = {label(it): partial(six.one_method, *it, z, p, stream) for it in six.METHODS}
    print(timing.write_costs("together", methods, repeat=30))


if __name__ == "__main__":
    main()
