"""The scorecard: the files that hold the verdicts of all papers together, and the two READMEs.

``figures/scorecard.csv`` has every verdict, the share of the seeds that give it and the verdict of
all seeds together (``data/seeds.csv``, made by ``benchmarks/seeds.py``).  README.md and its
translation README.zh.md have, between two markers each, the table of the papers and what came out
of them (``papers``), the counts of claims by kind (``scorecard``), and the caption of a product
(``caption <id>``).
"""

import contextlib
import re

import numpy as np
import pandas as pd

from tbdcore.repro import cite, claims, pages, paths, products

CAPTION = re.compile(r"<!-- caption (\w+/\w+) -->\n.*?<!-- /caption -->", re.DOTALL)
KINDS = {"number": "numbers", "ordering": "orderings", "trend": "trends"}
KINDS |= {"statement": "statements", "bound": "bounds"}
CHINESE = {
    "numbers": "数值",
    "orderings": "优劣次序",
    "trends": "变化趋势",
    "statements": "文字论断",
}
CHINESE |= {
    "bounds": "上下界",
    "all": "合计",
    "kind": "论断",
    "published": "已发表",
    "measured": "经实验检验",
}
CHINESE |= {"reproduced": "复现", "differs": "不符", "depends": "取决于理解"}
CHINESE |= {"inconclusive": "未定", "not measured": "未经实验检验"}
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
    counts = by_kind(every)
    english = {"papers": papers(), "scorecard": counts}
    texts = {paths.readme(): captions(_between(paths.readme(), english), folder)}
    if chinese().is_file():
        translated = counts.rename(columns=CHINESE).replace({"kind": CHINESE, "论断": CHINESE})
        texts[chinese()] = _between(chinese(), {"papers": papers("_zh"), "scorecard": translated})
    return texts


def _between(path, tables):
    """The text of a README with the tables between their markers; ValueError without them."""
    text = path.read_text(encoding="utf-8")
    for name, table in tables.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
        before, _, rest = text.partition(begin)
        _, found, after = rest.partition(end)
        if not found:
            lines = f"{begin.strip()} and {end}"
            raise ValueError(f"{path.name}: {lines} are missing; a table goes between them")
        text = f"{before}{begin}{products.markdown(table)}{end}{after}"
    return text


def papers(language=""):
    """Chapter, paper and what came out of it, one row a paper, in English or, "_zh", Chinese."""
    heads = ("章", "论文", "结果") if language else ("chapter", "paper", "what came out")
    rows = []
    for paper, about in cite.papers().items():
        topic, result = about.get(f"topic{language}", ""), about.get(f"result{language}", "")
        chapter = f"[{pages.path(paper).stem[:2]}](notebooks/{pages.path(paper).name}) {topic}"
        rows.append((chapter, cite.named(about, language), result))
    return pd.DataFrame(rows, columns=heads)


def by_kind(every):
    """How many claims of each kind are published and measured, and what came of the measured."""
    kinds = {p: {id: row.kind for id, row in claims.read(p).items()} for p in claims.papers()}
    every = every.assign(
        kind=[kinds[paper][id] for paper, id in zip(every["paper"], every["id"], strict=True)]
    )
    rows = []
    for name, shown in [*KINDS.items(), (None, "all")]:
        group = every[every["kind"].isin(KINDS) if name is None else every["kind"] == name]
        verdicts = group[group["evidence"] == "measured"]["verdict"].value_counts()
        counts = {verdict: int(verdicts.get(verdict, 0)) for verdict in claims.JUDGED}
        row = {"kind": shown, "published": len(group), "measured": sum(counts.values())}
        rows.append(row | counts | {"not measured": len(group) - sum(counts.values())})
    return pd.DataFrame(rows)


def depending(every):
    """The measured rows that depend on a reading, in a sentence; empty if there is none."""
    parts = []
    for paper, rows in every[every["verdict"] == "depends"].groupby("paper", sort=False):
        parts.append(f"{link(paper)} {', '.join(f'`{id}`' for id in rows['id'])}")
    return f"These depend on a reading: {'; '.join(parts)}." if parts else ""


def together(every):
    """The rows whose verdict is another one on the trials of all seeds together, in a sentence."""
    studied, changed = every[every["together"].notna()], {}
    odd = studied[studied["together"] != studied["verdict"]]
    for (paper, old, new), rows in odd.groupby(["paper", "verdict", "together"], sort=False):
        ids = ", ".join(f"`{id}`" for id in rows["id"])
        changed.setdefault(paper, []).append(f"{ids} ({new}, not {old})")
    parts = [f"{link(paper)} {', '.join(texts)}" for paper, texts in changed.items()]
    said = f"these another verdict: {'; '.join(parts)}" if parts else "the same verdicts"
    return f"All seeds together give {said}." if len(studied) else ""


def link(paper):
    """A link from a notebook to the page of a paper."""
    notebook = pages.path(paper)
    return f"[{notebook.stem[:2]}]({notebook.name})"
