"""Whether the verdicts depend on the seed: ``python -m benchmarks.seeds``, hours, restartable.

Every paper, or each one that is named, is swept over nine seeds at its defaults; with the committed
verdicts, those of the notebook's own seed, each claim has ten verdicts.  ``data/seeds.csv`` counts
them, and has the verdict of each number on the trials of all seeds together.  Runs that are done
with the same sources are not made again, so an interrupted study goes on where it stopped.

``python -m benchmarks.seeds PAPER CLAIM ...`` does so for some claims, by the cells that they need.

``python -m benchmarks.seeds PAPER tables`` makes the chapter's tables of methods and limits with
five other seeds, by the cells that they need, and writes each number to ``data/tables_seeds.csv``.
``n_trials=20000`` after it flies fewer trials.  A sentence that compares two rows of a table holds
for these seeds pooled: see ``lead``.
"""

import io
import math
import subprocess
import sys

import numpy as np
import pandas as pd

from benchmarks import rows
from tbdcore.repro import claims, cli, pages, paths, products, scorecard, studies, tables

SEEDS = range(21, 30)  # the notebooks' own seed is 20
FIVE = SEEDS[:5]  # those of the tables
TABLE_COLUMNS = ["paper", "table", "row", "column", "seed", "value", "se"]


def sweep(paper):
    """Sweep one paper; returns the verdicts of every seed, the committed ones among them."""
    values = "seed=" + ",".join(map(str, SEEDS))
    if status := cli.main(["sweep", paper, values, "--resume"]):
        sys.exit(status)
    swept = pd.read_csv(paths.build() / "sweep" / paper / "seed.csv", dtype=str)
    own = claims.verdicts(paper, paths.products()).rename(columns={"id": "claim"})
    return pd.concat([own.assign(value="own"), swept], ignore_index=True)


def single(paper, ids):
    """Verdicts of every seed on some claims of a paper, the committed ones among them."""
    own = claims.verdicts(paper, paths.products()).rename(columns={"id": "claim"})
    found = [own[own["claim"].isin(ids)].assign(value="own")]
    for seed in SEEDS:
        table = pd.DataFrame(rows.verdicts(paper, ids, seed=seed).values()).astype(str)
        found.append(table.rename(columns={"id": "claim"}).assign(value=str(seed)))
        print(seed, *table["measured"], *table["verdict"], flush=True)
    return pd.concat(found, ignore_index=True)


def counts(tables):
    """For each judged claim the number of seeds and of each verdict, papers one after the other."""
    every = pd.concat(tables, names=["paper"]).reset_index("paper")
    every = every[every["verdict"].isin(claims.JUDGED)]
    found = pd.get_dummies(every["verdict"], dtype=int)
    found = found.reindex(columns=claims.JUDGED, fill_value=0)
    found = found.groupby([every["paper"], every["claim"]], sort=False).sum()
    found.insert(0, "seeds", found.sum(axis=1))
    return found.reset_index()


def together(tables):
    """For each number its verdict on all trials of all seeds; rows (paper, claim, together).

    Without one that depends on a reading: the other options are not in the tables.
    """
    found = []
    for paper, table in tables.items():
        ledger = claims.Ledger(paper, strict=False)
        numbers = [id for id, claim in ledger.claims.items() if claim.kind == "number"]
        for id, runs in table[table["claim"].isin(numbers)].groupby("claim", sort=False):
            texts = runs[["measured", "se", "n"]]
            m, se, n = texts.apply(pd.to_numeric, errors="coerce").to_numpy().T
            if np.isfinite(m + se + n).all() and "depends" not in set(runs["verdict"]):
                error = np.sqrt((se**2).sum()) / len(se)
                verdict = ledger.judged(ledger.claims[id], m.mean(), error, n.sum()).verdict
                found.append((paper, id, verdict))
    return pd.DataFrame(found, columns=["paper", "claim", "together"])


def numbers(paper, name, seed, text):
    """The numbers of a table of methods or limits that have an error, a row each; a word is NaN."""
    frame, found = tables.read(io.StringIO(text)), []
    measures = [column for column in frame if f"{column}_se" in frame]
    for _, row in frame.iterrows():
        for column in measures:
            pair = pd.to_numeric(row[[column, f"{column}_se"]], errors="coerce")
            found.append((paper, name, row.iloc[0], column, seed, *pair))
    return found


def of_tables(paper, **values):
    """Methods and limits of a paper with five other seeds, a row for each number.

    Without the numbers that each seed repeats with their errors: they come from a study.
    """
    found = []
    for seed in FIVE:
        for name, text in rows.tables(paper, seed=seed, **values).items():
            found += numbers(paper, name, seed, text)
        print(paper, seed, flush=True)
    table = pd.DataFrame(found, columns=TABLE_COLUMNS)
    each = table.groupby(["table", "row", "column"])
    kinds = each[["value", "se"]].transform("nunique")
    repeated = (kinds == 1).all(axis=1) & (table["se"] > 0)
    repeated &= each["value"].transform("count") == len(FIVE)  # a word is no number
    return table[~repeated].reset_index(drop=True)


def read_tables():
    """The numbers of the tables of all papers with five other seeds; a word is NaN."""
    table = studies.read("tables_seeds")
    table[["value", "se"]] = table[["value", "se"]].apply(pd.to_numeric)
    return table


def write_tables(paper, **values):
    """Fly them, and write the file with the numbers of the other papers."""
    table, file = of_tables(paper, **values), paths.seeds().with_name("tables_seeds.csv")
    said = " ".join([f"{paper} tables", *(f"{name}={value}" for name, value in values.items())])
    head = f"# python -m benchmarks.seeds {said}; seeds {FIVE[0]} to {FIVE[-1]}\n"
    if file.is_file():
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        head = "".join(it for it in lines if it[0] == "#" and f" {paper} tables" not in it) + head
        old = read_tables()
        table = pd.concat([old[old["paper"] != paper], table], ignore_index=True)
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


def lead(table, column, row, other):
    """By how much a row of a table of one paper exceeds another in a column, and the error of that:
    the mean of the seeds' differences.  Both rows have a number for each seed, else ValueError.
    """
    own, theirs = (
        table[(table["row"] == name) & (table["column"] == column)].set_index("seed")
        for name in (row, other)
    )
    if not len(own) or set(own.index) != set(theirs.index):
        raise ValueError(f"{column}: no numbers of {row!r} and {other!r} for the same seeds")
    gap = (own["value"] - theirs["value"]).to_numpy()
    if not np.isfinite(gap).all():
        raise ValueError(f"{column}: {row!r} or {other!r} has a word, no number")
    errors = np.hypot(own["se"], theirs["se"].reindex(own.index))
    return gap.mean(), math.sqrt((errors**2).sum()) / len(gap)


def replaced(table, old):
    """An old table, with the rows of some claims made anew, or added at its end."""
    new, old = (each.set_index(["paper", "claim"]) for each in (table, old))
    both = pd.concat([new, old])
    return both[~both.index.duplicated()].loc[old.index.union(new.index, sort=False)].reset_index()


def merged(table, old, papers):
    """A table of some papers, and the rows of the others from an older one."""
    kept = old[old["paper"].isin([*pages.papers()]) & ~old["paper"].isin(papers)]
    every = pd.concat([kept, table], ignore_index=True) if len(kept) else table
    order = every["paper"].map({paper: place for place, paper in enumerate(pages.papers())})
    return every.iloc[order.argsort(kind="stable")]


def main():
    """Make the study and write the file, with the commit and the command in its first line."""
    words = sys.argv[1:]
    if words[1:2] == ["tables"]:
        values = {name: int(value) for name, value in (word.split("=") for word in words[2:])}
        return write_tables(pages.paper_of(words[0]), **values)
    known = claims.read(pages.paper_of(words[0], pages.papers())) if words else {}
    ids = [word for word in words if word in known]
    papers = [pages.paper_of(word, pages.papers()) for word in words if word not in ids]
    papers = papers or pages.papers()
    git = ["git", "-C", str(paths.root()), "describe", "--always", "--dirty"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    tables = {paper: single(paper, ids) if ids else sweep(paper) for paper in papers}
    table = counts(tables).merge(together(tables), how="left")
    rows_now = zip(table["paper"], table["claim"], strict=True)
    table["row"] = [claims.row_digest(claims.read(paper)[id]) for paper, id in rows_now]
    file, said = paths.seeds(), " ".join(["python -m benchmarks.seeds", *words])
    before = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    heads = [line for line in before if line.startswith("#") and words]
    head = "".join(f"{line}\n" for line in [*heads, f"# {said}, at commit {commit}"])
    old = scorecard.study()
    table = replaced(table, old) if ids else merged(table, old, papers)
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


if __name__ == "__main__":
    main()
