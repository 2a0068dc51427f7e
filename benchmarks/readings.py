"""Rows judged under every reading of the paper's words: ``python -m benchmarks.readings``, minutes.

It writes ``data/readings_flown.csv``: for each row and each reading what is measured, its error,
the verdict, and the digest of what flew it.  A verdict is ``depends`` when this file says so.
Papers and rows that are named are flown, the others keep their lines:
``python -m benchmarks.readings ljipda_ai con.dense``.  With ``--stamp`` those that are behind their
sources are flown again, and get the digest of these if nothing else differs (``tbdcore stamp``).

A chapter adds a row in ``benchmarks/readings_<paper>.py``:

    USES = ("scene", "ends")  # functions and constants of the page, from its cells
    ROWS = {"con.dense": dense}  # functions by the id of the claim

A function takes `page`, a namespace of USES, and a list of readings, dicts {name: option} with all
combinations, the default first; it returns a ``claims.Option`` for each, None where the two cannot
be combined.  `compared` makes them of the values of each trial.
"""

import functools
import importlib.util
import inspect
import itertools
import math
import sys
import types
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks import rows
from tbdcore.repro import claims, pages, paths, products, reach

FILE = "readings_flown.csv"


def studies(paper):
    """The module that flies rows of a paper, None where there is none."""
    name = f"benchmarks.readings_{paper}"
    return importlib.import_module(name) if importlib.util.find_spec(name) else None


def combinations(ledger, id):
    """The readings of a claim, dicts {name: option}: all combinations of those that live."""
    touching = [it for it in ledger.readings.values() if it.touches(id) and it.others()]
    each = [[(it.name, option) for option in (it.default, *it.others())] for it in touching]
    return [dict(pairs) for pairs in itertools.product(*each)]


def named(ledger, reading):
    """A reading as the file has it: the options that are not the default."""
    changed = [
        f"{name}: {it}" for name, it in reading.items() if it != ledger.readings[name].default
    ]
    return "; ".join(changed) or "default"


def compared(values, error=None):
    """Options of values (reading, trial) or (reading, trial, margin), the default first.

    `error` gives the standard error of a mean from the values of the trials; else their scatter.
    """

    def scatter(x):
        return x.std(axis=0) / math.sqrt(len(x))

    error, default = error or scatter, np.asarray(values[0], float)
    options = []
    for value in np.asarray(values, float):
        gap = value - default
        means = value.mean(axis=0), gap.mean(axis=0)
        options.append(claims.Option(*means, error(gap), error(value), len(value)))
    return options


@functools.cache
def used(paper, names):
    """What a study uses of a page, executed once: a class has to stay the same for all rows."""
    return types.SimpleNamespace(**rows.definitions(paper, names))


def lines(paper, id, study):
    """The lines of one claim, as tuples."""
    ledger = claims.Ledger(paper, strict=False)
    claim, readings = ledger.named(id, ledger.claims), combinations(ledger, id)
    page = used(paper, study.USES)
    options = zip(readings, study.ROWS[id](page, readings), strict=True)
    options = {named(ledger, reading): option for reading, option in options if option}
    beyond = claims.apart({key: it for key, it in options.items() if key != "default"})
    made = digest(paper, id, study)
    for reading, it in options.items():
        row = ledger.judged(claim, it.measured, it.se, it.n)
        far = "yes" if reading in beyond else "no"
        yield paper, id, reading, row.measured, row.se, row.n, far, row.verdict, made


def digests(paper, ids, study):
    """For each row a short hash of what flies it: the study, the cells of the page that it uses,
    what these reach, the claim without its cause, its readings without words.
    """
    own = [inspect.getsource(compared), Path(study.__file__).read_text(encoding="utf-8")]
    code = [*rows.sources(paper, study.USES), *pages.cells(paper, "algorithm"), *own]
    reached = repr(sorted(reach.of_code("\n\n\n".join(code)).items()))
    published, listed, made = claims.read(paper), claims.readings(paper).values(), {}
    for id in ids:
        touching = [repr(it._replace(words="")) for it in listed if it.touches(id)]
        parts = [reached, *published[id][:-1], *touching]
        made[id] = products.digest([part.encode() for part in parts])
    return made


def digest(paper, id, study):
    """The hash of what flies one row."""
    return digests(paper, [id], study)[id]


def stale():
    """What the file has that its sources would not make, or lacks, in words."""
    wrong = []
    for paper in pages.papers():
        have, study = claims.flown(paper), studies(paper)
        known = study.ROWS if study else {}
        now = digests(paper, known, study) if study else {}
        for id in dict.fromkeys([*have, *known]):
            again = f"python -m benchmarks.readings {paper} {id}"
            if id not in known:
                wrong.append(f"{paper} {id}: no study flies it; delete its lines from {FILE}")
            elif id not in have:
                wrong.append(f"{paper} {id} is not flown: {again}")
            elif {it.digest for it in have[id]} != {now[id]}:
                wrong.append(f"{paper} {id} is behind its sources: {again}")
    return wrong


def stamped(have, new):
    """Lines that were flown again; ValueError when more than their digests differ from the file."""
    ours, theirs = (pd.DataFrame(it, columns=claims.Flown._fields) for it in (have, new))
    same = products.csv(ours.drop(columns="digest")) == products.csv(theirs.drop(columns="digest"))
    if not same:
        paper, id = new[0][:2]
        again = f"python -m benchmarks.readings {paper} {id}"
        raise ValueError(f"{paper} {id}: not as in {FILE}; no stamp is renewed; take it: {again}")
    return new


def wanted(words):
    """The rows of the studies that are named, all if none is, as {paper: ids}; ValueError for
    others.
    """
    papers = [pages.paper_of(words[0], pages.papers())] if words else pages.papers()
    known = {paper: [*study.ROWS] for paper in papers if (study := studies(paper))}
    every = [id for ids in known.values() for id in ids]
    for word in words[1:]:
        if word not in every:
            raise ValueError(f"{papers[0]} {word}: no study flies it; known are {every}")
    return {paper: [id for id in ids if id in (words[1:] or ids)] for paper, ids in known.items()}


def main(words, stamp=False):
    """Fly rows, and write the file; with `stamp` only digests may change."""
    chosen, path, made = wanted(words), paths.claims().parent / FILE, []
    for paper in pages.papers():
        have, study = claims.flown(paper), studies(paper)
        now = digests(paper, study.ROWS, study) if stamp and study else {}
        for id in claims.read(paper):
            named = id in chosen.get(paper, ())
            if named and not (stamp and {it.digest for it in have.get(id, ())} == {now[id]}):
                flown = [*lines(paper, id, study)]
                print(*(f"{paper} {id}: {it[2]}, {it[-2]}" for it in flown), sep="\n", flush=True)
                made += stamped(have.get(id, []), flown) if stamp else flown
            else:
                made += have.get(id, [])
    table = pd.DataFrame(made, columns=claims.Flown._fields)
    products.write(path.parent, {FILE: products.csv(table)})


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--stamp"]
    try:
        main(given, stamp="--stamp" in sys.argv)
    except ValueError as error:
        sys.exit(str(error))
