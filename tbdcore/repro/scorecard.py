"""The scorecard: the files that hold the verdicts of all papers together, and the two READMEs.

``figures/scorecard.csv`` has every verdict, the share of the seeds that give it and the verdict of
all seeds together (``data/seeds.csv``, made by ``benchmarks/seeds.py``).  Between two markers of
README.md are a table of the papers, and the rows whose verdict all seeds change;
``README.zh.md``, its translation, has a table of its own there.  Between ``<!-- caption <id> -->``
and ``<!-- /caption -->`` stands the caption of a product.
"""

import contextlib
import re

import numpy as np
import pandas as pd

from tbdcore.repro import cite, claims, pages, paths, products

BEGIN, END = "<!-- scorecard -->\n", "<!-- /scorecard -->"
CAPTION = re.compile(r"<!-- caption (\w+/\w+) -->\n.*?<!-- /caption -->", re.DOTALL)
CHINESE_VERDICTS = ("重现", "不符", "取决于理解", "未定")  # as claims.JUDGED
STEADY = 0.9  # share of the seeds below which a verdict is marked
UNSTEADY = f"other verdict in more than {1 - STEADY:.0%} of the seeds"


def files(folder, readme):
    """The files made of a folder's verdicts, path -> bytes; with the repository's READMEs if
    wanted.  Raises like :func:`tbdcore.repro.claims.verdicts`.
    """
    every = with_seeds(claims.ledger(folder))
    counts = claims.scorecard(folder).set_index("paper")
    unsteady = every[every["seeds"] < STEADY].groupby("paper").size()
    unsteady["all"] = unsteady.sum()
    counts[UNSTEADY] = unsteady.reindex(counts.index, fill_value=0)
    texts = {folder / "scorecard.md": products.markdown(counts.reset_index())}
    texts |= {folder / "figures.bib": cite.bibliography(), folder / "README.md": cite.listing()}
    if readme:
        texts |= _readmes(every, folder)
    made = {path: text.encode() for path, text in texts.items()}
    return {folder / "scorecard.csv": products.csv(every)} | made


def study():
    """The study: paper, claim, number of seeds, of each verdict, a number's verdict on all trials
    together, and the digest of the judged row; empty without one, ValueError when the file is no
    such table.
    """
    columns = ["paper", "claim", "seeds", *claims.JUDGED, "together", "row"]
    if not paths.seeds().is_file():
        return pd.DataFrame(columns=columns)
    table = pd.DataFrame()
    with contextlib.suppress(ValueError):  # pandas' own errors are ValueErrors
        table = pd.read_csv(paths.seeds(), comment="#", dtype={"row": str})
    if list(table) != columns or not len(table):
        reason = "no table of seeds; make it anew: python -m benchmarks.seeds"
        raise ValueError(f"{paths.seeds()}: {reason}")
    return table


def stale():
    """The claims of the study whose printed value or rule is another today, as the words of the
    command that makes them anew, paper by paper; or that are no claims any more.
    """
    judged = study()
    old = judged[~_judges_present_rows(judged)]
    return [f"{paper} {' '.join(rows['claim'])}" for paper, rows in old.groupby("paper")]


def _judges_present_rows(judged):
    """Which rows of the study judge the printed value and the rule of today."""
    digests = {paper: _digests(paper) for paper in claims.papers()}
    now = zip(judged["paper"], judged["claim"], judged["row"], strict=True)
    return np.array([digests.get(paper, {}).get(id) == row for paper, id, row in now], bool)


def _digests(paper):
    return {id: claims.row_digest(claim) for id, claim in claims.read(paper).items()}


def with_seeds(every):
    """A table of verdicts; a column `seeds`, the share of the seeds that give the verdict, and
    `together`, the verdict of a number on the trials of all seeds: both empty where the study has
    judged another value or rule.
    """
    keys, judged = pd.MultiIndex.from_frame(every[["paper", "id"]]), study()
    judged = judged[_judges_present_rows(judged)].set_index(["paper", "claim"]).reindex(keys)
    same = every["verdict"].to_numpy()
    share = sum((judged[v].where(same == v, 0) for v in claims.JUDGED), 0.0) / judged["seeds"]
    return every.assign(seeds=share.to_numpy(float), together=judged["together"].to_numpy())


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


def captions(text, folder):
    """A text with the captions of the products in a folder; as it was where there is none."""

    def caption(mark):
        file = folder / f"{mark[1]}.json"
        if not file.is_file():
            return mark[0]
        said = products.record(file)["caption"]
        return f"<!-- caption {mark[1]} -->\n*{said}*\n<!-- /caption -->"

    return CAPTION.sub(caption, text)


def chinese():
    """The Chinese README, which need not exist."""
    return paths.readme().with_name("README.zh.md")


def _readmes(every, folder):
    """The READMEs made anew, path -> text."""
    english, translated = map(products.markdown, _tables(every))
    text = _between(paths.readme(), f"{english}{depending(every)}{_together(every)}")
    texts = {paths.readme(): captions(text, folder)}
    if chinese().is_file():
        texts[chinese()] = _between(chinese(), translated)
    return texts


def _between(path, made):
    """The text of a README with what is made between its markers; ValueError without them."""
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        lines = f"{BEGIN.strip()} and {END.strip()}"
        raise ValueError(f"{path.name}: {lines} are missing; the table of papers goes between them")
    return f"{before}{BEGIN}{made}{END}{after}"


def depending(every):
    """The measured rows that depend on a reading, in a sentence; empty if there is none."""
    parts = []
    for paper, rows in every[every["verdict"] == "depends"].groupby("paper", sort=False):
        parts.append(f"{_link(paper)} {', '.join(f'`{id}`' for id in rows['id'])}")
    said = f"\nThese depend on a [reading](data/readings.csv): {'; '.join(parts)}.\n"
    return said if parts else ""


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


def _tables(every):
    """The tables of the READMEs: each paper, what came of its measured claims, and in English how
    many others there are.
    """
    english, translated = [], []
    for paper, about in cite.papers().items():
        counts = claims.counts(every[every["paper"] == paper])
        measured = {verdict: counts[f"measured: {verdict}"] for verdict in claims.JUDGED}
        others = [name for name in (*claims.EVIDENCE[1:], "untestable", "used") if counts[name]]
        row = {"paper": f"{about['topic']} ({about['short']})", "notebook": _link(paper)}
        row |= {"measured": sum(measured.values())} | measured
        row["not measured"] = ", ".join(f"{counts[name]} {name}" for name in others)
        english.append(row | {"run time": about.get("run_time", "")})
        row = {"章": _link(paper), "内容": about.get("topic_zh", "")}
        row |= {"论文的论断": about.get("claim_zh", ""), "结果": about.get("result_zh", "")}
        row["实测"] = sum(measured.values())
        translated.append(row | dict(zip(CHINESE_VERDICTS, measured.values(), strict=True)))
    return pd.DataFrame(english), pd.DataFrame(translated)
