"""Whether the verdicts hang on the seed: ``python -m benchmarks.seeds``, hours, restartable.

Every paper is swept over nine seeds at its defaults; with the committed verdicts, those of the
notebook's own seed, each claim has ten verdicts.  ``data/seeds.csv`` counts them.  Runs that are
done with the same sources are not made again, so an interrupted study goes on where it stopped.
"""

import subprocess
import sys

import pandas as pd

from tbdcore.repro import claims, cli, pages, paths, products, scorecard

SEEDS = range(21, 30)  # the notebooks' own seed is 20


def sweep(paper):
    """Sweep one paper; returns the verdicts of every seed, the committed ones among them."""
    values = "seed=" + ",".join(map(str, SEEDS))
    if status := cli.main(["sweep", paper, values, "--resume"]):
        sys.exit(status)
    swept = pd.read_csv(paths.BUILD / "sweep" / paper / "seed.csv", dtype=str)
    own = claims.verdicts(paper, paths.PRODUCTS).rename(columns={"id": "claim"})
    return pd.concat([own.assign(value="own"), swept], ignore_index=True)


def counts(tables):
    """For each judged claim the number of seeds and of each verdict, papers one after the other."""
    every = pd.concat(tables, names=["paper"]).reset_index("paper")
    every = every[every["verdict"].isin(claims.VERDICTS[:3])]
    found = pd.get_dummies(every["verdict"], dtype=int)
    found = found.reindex(columns=claims.VERDICTS[:3], fill_value=0)
    found = found.groupby([every["paper"], every["claim"]], sort=False).sum()
    found.insert(0, "seeds", found.sum(axis=1))
    return found.reset_index()


def main():
    """Make the study and write the file, with the commit and the command in its first line."""
    git = ["git", "-C", str(paths.ROOT), "describe", "--always", "--dirty"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    table = counts({paper: sweep(paper) for paper in pages.papers()})
    head = f"# python -m benchmarks.seeds, at commit {commit}\n"
    file = scorecard.seeds_file()
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


if __name__ == "__main__":
    main()
