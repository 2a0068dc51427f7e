"""The scorecard: the files that hold the verdicts of all papers together.

``figures/scorecard.csv`` has every verdict, the share of the seeds that give it and the verdict of
all seeds together (``data/seeds.csv``, made by ``benchmarks/seeds.py``); between two markers of the
repository's README are a table of the papers, and the rows whose verdict all seeds change.
"""

import contextlib

import pandas as pd

from tbdcore.repro import cite, claims, front, pages, paths, products

BEGIN, END = front.BEGIN, front.END
STEADY = 0.9  # share of the seeds below which a verdict is marked
UNSTEADY = f"other verdict in more than {1 - STEADY:.0%} of the seeds"


def files(folder, readme):
    """The files made of a folder's verdicts, path -> bytes; with the repository's README if wanted.

    Raises like :func:`tbdcore.repro.claims.verdicts`.
    """
    every = with_seeds(claims.ledger(folder))
    counts = claims.scorecard(folder).set_index("paper")
    unsteady = every[every["seeds"] < STEADY].groupby("paper").size()
    unsteady["all"] = unsteady.sum()
    counts[UNSTEADY] = unsteady.reindex(counts.index, fill_value=0)
    texts = {folder / "scorecard.md": products.markdown(counts.reset_index())}
    texts |= {folder / "figures.bib": cite.bibliography(), folder / "README.md": cite.gallery()}
    if readme:
        texts |= {paths.README: front.captions(_readme(every), folder)} | front.files(every)
    made = {path: text.encode() for path, text in texts.items()}
    return {folder / "scorecard.csv": products.csv(every)} | made


def study():
    """The study: paper, claim, number of seeds, of each verdict, and a number's verdict on all
    trials together; empty without one, ValueError when the file is no such table.
    """
    columns = ["paper", "claim", "seeds", *claims.JUDGED, "together"]
    if not paths.SEEDS.is_file():
        return pd.DataFrame(columns=columns)
    table = pd.DataFrame()
    with contextlib.suppress(ValueError):  # pandas' own errors are ValueErrors
        table = pd.read_csv(paths.SEEDS, comment="#")
    if list(table) != columns or not len(table):
        wrong = "no table of seeds; make it anew: python -m benchmarks.seeds"
        raise ValueError(f"{paths.SEEDS}: {wrong}")
    return table


def with_seeds(every):
    """A table of verdicts; a column `seeds`, the share of the seeds that give the verdict, and
    `together`, the verdict of a number on the trials of all seeds.
    """
    found = study().set_index(["paper", "claim"])
    keys = pd.MultiIndex.from_frame(every[["paper", "id"]])
    found, same = found.reindex(keys), every["verdict"].to_numpy()
    share = sum((found[v].where(same == v, 0) for v in claims.JUDGED), 0.0) / found["seeds"]
    return every.assign(seeds=share.to_numpy(float), together=found["together"].to_numpy())


def changes(folder):
    """The claims whose verdict is not the one in a folder's scorecard.csv, in words."""
    scorecard, key = folder / "scorecard.csv", ["paper", "id"]
    if not scorecard.is_file():
        return []
    try:
        earlier = pd.read_csv(scorecard, dtype=str, keep_default_na=False)[[*key, "verdict"]]
    except (KeyError, ValueError):  # pandas' own errors are ValueErrors
        advice = "delete it, then make it anew: tbdcore score"
        raise ValueError(f"{scorecard}: no scorecard; {advice}") from None
    both = claims.ledger(folder).merge(earlier, on=key, suffixes=("", "_old"))
    changed = both[both["verdict"] != both["verdict_old"]].itertuples()
    return [f"{row.paper} {row.id} was {row.verdict_old}, is {row.verdict}" for row in changed]


def _readme(every):
    """README.md with the table of papers between its markers made anew."""
    before, _, rest = paths.README.read_text(encoding="utf-8").partition(BEGIN)
    _, found, after = rest.partition(END)
    if not found:
        lines = f"{BEGIN.strip()} and {END.strip()}"
        raise ValueError(f"README.md: {lines} are missing; the table of papers goes between them")
    said = front.depending(every) + _together(every)
    return f"{before}{BEGIN}{products.markdown(_papers(every))}{said}{END}{after}"


def _together(every):
    """The rows whose verdict is another one on the trials of all seeds together, in a sentence."""
    studied, changed = every[every["together"].notna()], {}
    odd = studied[studied["together"] != studied["verdict"]]
    for (paper, old, new), rows in odd.groupby(["paper", "verdict", "together"], sort=False):
        ids = ", ".join(f"`{id}`" for id in rows["id"])
        changed.setdefault(paper, []).append(f"{ids} ({new}, not {old})")
    parts = [f"{_link(paper)} {', '.join(texts)}" for paper, texts in changed.items()]
    said = f"these another verdict: {'; '.join(parts)}" if parts else "the same verdicts"
    return f"\nAll [seeds](data/seeds.csv) together give {said}.\n" if len(studied) else ""


def _link(paper):
    notebook = pages.path(paper)
    return f"[{notebook.stem}](notebooks/{notebook.name})"


def _papers(every):
    """README's table: what came of each paper's measured claims, and how many others there are."""
    rows = []
    for paper, about in cite.papers().items():
        counts = claims.counts(every[every["paper"] == paper])
        measured = {verdict: counts[f"measured: {verdict}"] for verdict in claims.JUDGED}
        others = [name for name in (*claims.EVIDENCE[1:], "untestable", "used") if counts[name]]
        row = {"paper": f"{about['topic']} ({about['short']})", "notebook": _link(paper)}
        row |= {"measured": sum(measured.values())} | measured
        row["not measured"] = ", ".join(f"{counts[name]} {name}" for name in others)
        rows.append(row | {"run time": about.get("run_time", "")})
    return pd.DataFrame(rows)
