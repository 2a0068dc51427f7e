"""CPU time of one flight by the methods of chapter 04: ``python -m benchmarks.track_cfar_cost``."""

from functools import partial

from benchmarks import timing, track_cfar_elsewhere
from benchmarks.track_cfar_tuned import page
from tbdcore.repro import trials


def main():
    """Time a flight with each method on one scene, and write the file."""
    p = page.Scenario()
    true = page.truth(p)
    scene = page.simulate(true, p, trials.generator(1, "track_cfar", "cost", 0, "noise"))
    designs = track_cfar_elsewhere.designs(p)
    timing.write_costs(
        "track_cfar", {name: partial(page.fly, scene, true, d) for name, d in designs.items()}
    )


if __name__ == "__main__":
    main()
