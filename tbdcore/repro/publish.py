"""A notebook's run: ``begin`` opens it, right after its parameters cell, ``publish`` ends it.

Products of an earlier run that this one no longer makes are removed.  A run that fails or is
interrupted leaves the old products as they were.
"""

import contextlib

from tbdcore.repro import claims, figures, pages, paths, products, screen, trials

SUFFIXES = (*figures.CANVASES, "gif", "csv", "md", "tex", "json")  # of the files of a product


def begin(paper, namespace):
    """Open a notebook's run: ``ledger, portfolio = tbdcore.begin("track_cfar", vars())``.

    Checks every parameter (of a misspelt one papermill makes a plain variable, and goes on), puts
    coerced values back into `namespace`, and tries the output folder.  Without claims the ledger is
    None.
    """
    names = [name for name in namespace if isinstance(namespace[name], int | float | str | list)]
    own = [name for name in names if not name.startswith("_") and name != "In"]
    given = (*pages.parameters(paper), *own)
    values = pages.validate(paper, {name: namespace[name] for name in given})
    namespace.update(values)
    folder = pages.destination(paper, values)
    ledger = None
    if pages.has_ledger(paper):
        ledger = claims.Ledger(paper, strict=not pages.changed(paper, values))
    artist = trials.process() if trials.cores() > 1 else None
    return ledger, Publication(paper, folder, pages.provenance(paper, values), artist)


class Publication(figures.Portfolio):
    """The portfolio of a notebook, which its last cell publishes."""

    def publish(self, ledger=None):
        """Write all products and verdicts.csv; nothing, and ValueError, if a claim has no verdict.

        The first screen then shows what a default run has written.
        """
        table = [] if ledger is None else ledger.table()
        verdicts = {} if ledger is None else {"verdicts.csv": products.csv(table)}
        for job in self.waiting:
            self.files |= job.result()
        if self.artist:
            self.artist.shutdown()
        files = verdicts | self.files  # a product's JSON is the last of its files
        folder, earlier = self.folder / self.paper, []
        for file in folder.glob("*.json"):
            with contextlib.suppress(ValueError):  # it is no record
                if products.record(file)["paper"] == self.paper:
                    earlier += [file.with_suffix(f".{suffix}") for suffix in SUFFIXES]
        products.write(folder, files, old=[file for file in earlier if file.name not in files])
        judged = "no claims" if ledger is None else f"{len(table)} claims ({ledger.summary()})"
        print(f"{self.paper}: {judged}; {len(files)} files")
        default = self.provenance.get("remake") == f"tbdcore run {self.paper}"
        if default and self.folder == paths.products().resolve():
            screen.refresh(self.paper)
