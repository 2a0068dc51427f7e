"""Stamps: the digests of sources in the records of products, renewed without a new number.

A page whose sources have changed is executed beside its products.  Where nothing that it writes or
shows differs but for the digests, these are taken; otherwise nothing is.  Rows that were flown
under the readings of a paper are flown again in the same way.
"""

import json
import os
import sys
from pathlib import Path

from tbdcore.repro import batch, claims, pages, paths, processes, products
from tbdcore.repro.exits import CheckFailed


def stale(paper):
    """Names of the records of a page that have another digest than its sources."""
    digest = pages.digest(paper)
    records = sorted((paths.figures() / paper).glob("*.json"))
    return [file.name for file in records if products.record(file)["digest"] != digest]


def renew(paper, how):
    """Execute a page at its defaults and take the digests of its records; returns their names.

    `how` are options of :func:`batch.execute`.  CheckFailed, with nothing changed, when the run
    fails, or when a file or an output of the notebook is not the committed one.
    """
    folder = paths.build() / "stamp"
    values = pages.validate(paper, {"out": str(folder)})
    result = batch.execute(paper, values, folder / pages.path(paper).name, **how)
    if result.error:
        raise CheckFailed(result.error)
    if other := different(paper, folder / paper, Path(result.notebook)):
        shown = ", ".join(other[:3]) + (f" and {len(other) - 3} more" if len(other) > 3 else "")
        advice = f"no stamp is renewed; look at {folder / paper}, then: tbdcore run {paper}"
        raise CheckFailed(f"{paper}: {shown}: not as committed; {advice}")
    names = stale(paper)
    records = {name: (folder / paper / name).read_bytes() for name in names}
    products.write(paths.figures() / paper, records)
    return names


def different(paper, folder, notebook):
    """What a run has made in a folder, and shown in a notebook, that is not as committed."""
    before, now = contents(paths.figures() / paper), contents(folder)
    names = [name for name in sorted({*before, *now}) if before.get(name) != now.get(name)]
    if outputs(pages.path(paper)) != outputs(notebook):
        names.append(f"outputs of {notebook.name}")
    if warning := pages.warned(json.loads(notebook.read_text(encoding="utf-8"))):
        names.append(warning)
    return names


def contents(folder):
    """The bytes of each file of a page's products; of a record all that it says but the digest."""
    made = {}
    for file in folder.iterdir():
        record = file.suffix == ".json"
        made[file.name] = products.record(file) | {"digest": ""} if record else file.read_bytes()
    return made


def outputs(notebook):
    """What the cells of an executed notebook show, in their order: texts and pictures."""
    cells = pages.clean(json.loads(notebook.read_text(encoding="utf-8")))["cells"]
    every = [it for cell in cells for it in cell.get("outputs", ())]
    shown = [it.get("text") or it.get("data") for it in every]
    return [_joined(it) for it in shown]


def _joined(shown):
    """An output with each of its texts in one piece: notebooks keep them in lines, or whole."""
    if isinstance(shown, dict):
        return {kind: _joined(it) for kind, it in shown.items()}
    return "".join(shown) if isinstance(shown, list) else shown


def fly_again(paper, came=None):
    """Let ``benchmarks.readings`` renew the digests of a paper's flown rows; CheckFailed, with
    nothing changed, when a row comes out otherwise.
    """
    if not claims.flown(paper):
        return
    log = paths.build() / "stamp" / f"{paper}.readings.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    words = [sys.executable, "-m", "benchmarks.readings", "--stamp", paper]
    where = os.environ | {"PYTHONPATH": str(paths.root())}
    if processes.call(words, where, log, lambda: None, came):
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        raise CheckFailed(lines[-1] if lines else f"{paper}: its rows could not be flown again")
