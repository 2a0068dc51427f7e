"""The front door: what the two READMEs show of products and verdicts.

Between ``<!-- caption <id> -->`` and ``<!-- /caption -->`` stands the caption of a product.
``README.zh.md`` follows README.md: it names the digest of the text that it translates, which leaves
out what is made of products, and has a table of its own between the markers of the scorecard.
"""

import re

from tbdcore.repro import cite, claims, pages, paths, products

BEGIN, END = "<!-- scorecard -->\n", "<!-- /scorecard -->"
CAPTION = re.compile(r"<!-- caption (\w+/\w+) -->\n.*?<!-- /caption -->", re.DOTALL)
VERDICTS = ("重现", "不符", "取决于理解", "未定")  # as claims.JUDGED


def captions(text, folder):
    """A text with the captions of the products in a folder; as it was where there is none."""

    def caption(found):
        file = folder / f"{found[1]}.json"
        if not file.is_file():
            return found[0]
        said = products.record(file)["caption"]
        return f"<!-- caption {found[1]} -->\n*{said}*\n<!-- /caption -->"

    return CAPTION.sub(caption, text)


def depending(every):
    """The measured rows that depend on a reading, in a sentence; empty if there is none."""
    rows, parts = every[every["verdict"] == "depends"], []
    for paper, group in rows.groupby("paper", sort=False):
        ids, notebook = ", ".join(f"`{id}`" for id in group["id"]), pages.path(paper)
        parts.append(f"[{notebook.stem}](notebooks/{notebook.name}) {ids}")
    said = f"\nThese depend on a [reading](data/readings.csv): {'; '.join(parts)}.\n"
    return said if parts else ""


def chinese():
    """The Chinese README."""
    return paths.README.with_name("README.zh.md")


def digest(text):
    """Short hash of README.md without what is made of products."""
    before, _, rest = text.partition(BEGIN)
    return products.digest([CAPTION.sub("", before + rest.partition(END)[2]).encode()])


def followed(text):
    """The digest that a Chinese README names, empty if it names none."""
    return (re.findall(r"^<!-- README\.md ([0-9a-f]+) -->$", text, re.MULTILINE) or [""])[0]


def files(every):
    """The Chinese README with its table made anew, path -> text; none without one."""
    if not chinese().is_file():
        return {}
    before, _, rest = chinese().read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    return {chinese(): f"{before}{BEGIN}{products.markdown(_table(every))}{END}{after}"}


def _table(every):
    """For each paper its chapter, its Chinese topic and result, and the counts of its claims."""
    import pandas as pd

    rows = []
    for paper, about in cite.papers().items():
        counts = claims.counts(every[every["paper"] == paper])
        measured = [counts[f"measured: {verdict}"] for verdict in claims.JUDGED]
        notebook = pages.path(paper)
        row = {
            "章": f"[{notebook.stem}](notebooks/{notebook.name})",
            "内容": about.get("topic_zh", ""),
        }
        row |= {"论文的论断": about.get("claim_zh", ""), "结果": about.get("result_zh", "")}
        rows.append(row | {"实测": sum(measured)} | dict(zip(VERDICTS, measured, strict=True)))
    return pd.DataFrame(rows)
