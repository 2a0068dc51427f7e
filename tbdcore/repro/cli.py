"""The command line: ``tbdcore run | sweep | score | cite | which | doctor``.

``run``     executes notebooks with checked parameters, one line of progress each, products written only on success
``sweep``   executes one notebook for each value of a parameter
``score``   the scorecard of all papers from their verdicts
``cite``    caption, files and BibTeX of a figure or table
``which``   what a picture is, what made it, and whether that has changed since
``doctor``  whether this machine can run it all

Exit codes: 0 good, 1 a check failed, 2 bad usage or input, 3 the environment.  An error is one line
on standard error: what, where, what to do.
"""

import argparse
import ast
import json
import os
import sys
from functools import partial
from pathlib import Path

from tbdcore.repro import paths

GOOD, FAILED, USAGE, ENVIRONMENT = 0, 1, 2, 3


class Fault(Exception):
    """An error to be told in one line, with its exit code."""

    def __init__(self, message, code=USAGE):
        super().__init__(message)
        self.code = code


def main(argv=None):
    """Entry point; returns the exit code."""
    try:
        arguments = _parser().parse_args(argv)
        paths.root()
        return arguments.command(arguments)
    except Fault as fault:
        return _complain(fault, fault.code)
    except (ValueError, FileNotFoundError) as error:
        return _complain(error, USAGE)
    except ModuleNotFoundError as error:
        said = f"{error.name} is missing; this needs the extra repro: pip install 'tbdcore[repro]'"
        return _complain(said, ENVIRONMENT)
    except OSError as error:
        return _complain(error, ENVIRONMENT)
    except KeyboardInterrupt:
        return _complain("interrupted; finished papers are kept, nothing is half written", 130)


def _complain(error, code):
    print(f"tbdcore: {' '.join(str(error).split())}", file=sys.stderr)
    return code


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message):
        raise Fault(f"{message}; see: {self.prog} --help")


def _parser():
    parser = _Parser(
        prog="tbdcore", description="Run, score and cite the reproduction of five radar papers."
    )
    commands = parser.add_subparsers(required=True, metavar="command", parser_class=_Parser)
    run = commands.add_parser(
        "run",
        help="execute notebooks",
        description="Execute notebooks; all papers if none is named.",
    )
    run.add_argument("papers", nargs="*", metavar="PAPER")
    _running(run)
    run.add_argument("--out", metavar="DIR", help="folder for the products instead of figures/")
    run.add_argument(
        "--in-place", action="store_true", help="refresh the committed notebooks as well"
    )
    run.set_defaults(command=_run)
    sweep = commands.add_parser(
        "sweep",
        help="one notebook over values of a parameter",
        description="Tidy CSV of all verdicts.",
    )
    sweep.add_argument("paper", metavar="PAPER")
    sweep.add_argument(
        "values", metavar="name=v1,v2,...", help="values of one parameter; between lists write ;"
    )
    _running(sweep)
    sweep.add_argument(
        "--out", metavar="DIR", help="folder for table and products instead of build/sweep/PAPER"
    )
    sweep.set_defaults(command=_sweep)
    score = commands.add_parser(
        "score",
        help="scorecard from the verdicts",
        description="Scorecard from the verdicts of all papers.",
    )
    score.add_argument(
        "--figures", metavar="DIR", help="folder that holds the products, instead of figures/"
    )
    score.add_argument(
        "--check",
        action="store_true",
        help="write nothing; fail when scorecard or README are stale",
    )
    score.set_defaults(command=_score)
    cite = commands.add_parser("cite", help="caption, files and BibTeX of a figure or table")
    cite.add_argument("id", metavar="PAPER/NAME", help="for instance track_cfar/fig05")
    forms = cite.add_mutually_exclusive_group()
    for form, said in _FORMS.items():
        forms.add_argument(
            f"--{form}", dest="form", action="store_const", const=form, default="", help=said
        )
    cite.add_argument(
        "--figures", metavar="DIR", help="folder that holds the products, instead of figures/"
    )
    cite.set_defaults(command=_cite)
    which = commands.add_parser(
        "which", help="what a file is, what made it, and whether that has changed since"
    )
    which.add_argument(
        "file", metavar="FILE", help="a PDF, SVG or PNG that tbdcore made, wherever it is now"
    )
    which.set_defaults(command=_which)
    doctor = commands.add_parser(
        "doctor", help="whether this machine can run it all, with a self-test"
    )
    doctor.set_defaults(command=_doctor)
    return parser


_FORMS = {
    "bibtex": "entries of the paper and of this repository",
    "caption": "the caption alone",
    "latex": "a complete figure or table environment",
    "markdown": "for Markdown",
}


def _running(parser):
    """The options that every execution has."""
    parser.add_argument(
        "-p",
        dest="given",
        action="append",
        default=[],
        metavar="name=value",
        help="set a parameter of the notebooks",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few trials, into build/; never touches figures/"
    )
    parser.add_argument("--workers", type=int, metavar="N", help="processes, 0 for one per core")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="address of a dask scheduler")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="skip what is done with the same sources and parameters",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="a JSON object for each run on standard output, progress elsewhere",
    )


def _run(arguments):
    """Execute the notebooks of some papers one after the other; a paper that fails does not stop
    the others.
    """
    from tbdcore.repro import batch, pages

    named = arguments.papers or (pages.papers() if arguments.given else pages.everything())
    jobs = {paper: _values(paper, arguments) for paper in named}
    _reachable(jobs.values())
    if arguments.in_place and (
        arguments.given or arguments.quick or arguments.out or arguments.resume
    ):
        raise Fault(
            "--in-place executes the committed notebooks with their defaults; drop -p, --quick, "
            "--out and --resume"
        )
    folder = paths.BUILD / "quick" if arguments.quick else paths.BUILD
    status = GOOD
    for paper, values in jobs.items():
        output = folder / pages.path(paper).name
        result = _told(
            arguments,
            paper,
            partial(
                batch.run, paper, values, output, say=_voice(arguments), resume=arguments.resume
            ),
        )
        if arguments.in_place and result.status == GOOD:
            _refresh(paper, output)
        status = max(status, result.status)
    return status


def _sweep(arguments):
    """Run one notebook for each value of a parameter."""
    from tbdcore.repro import batch, pages

    name, equals, text = arguments.values.partition("=")
    known = pages.parameters(arguments.paper)
    if arguments.paper not in pages.papers():
        raise Fault(
            f"sweep {arguments.paper}: it has no verdicts to tabulate; "
            f"sweep one of {', '.join(pages.papers())}"
        )
    if not equals or not text:
        raise Fault(f"sweep {arguments.values}: write the parameter and its values as name=v1,v2")
    if name in pages.PLUMBING:
        raise Fault(f"sweep {name}: it cannot change a result; sweep another parameter")
    listed = text.split(";" if name in known and known[name].type == "list" else ",")
    sets = [
        argparse.Namespace(**vars(arguments) | {"given": [*arguments.given, f"{name}={value}"]})
        for value in listed
    ]
    runs = [
        (value, _values(arguments.paper, each)) for value, each in zip(listed, sets, strict=True)
    ]
    _reachable(values for _, values in runs)
    folder = (
        pages.usable(arguments.out) if arguments.out else paths.BUILD / "sweep" / arguments.paper
    )
    results = batch.sweep(
        arguments.paper, name, runs, folder, say=_voice(arguments), resume=arguments.resume
    )
    ended = [_told(arguments, arguments.paper, partial(next, results)).status for _ in runs]
    if GOOD in ended:
        _voice(arguments)(f"{arguments.paper}: table in {folder / name}.csv")
    return max(ended)


def _voice(arguments):
    """Where lines of progress go: to standard output, or past the JSON that is there."""
    return partial(print, file=sys.stderr if arguments.json else sys.stdout, flush=True)


def _told(arguments, paper, run):
    """The result of a run, reported."""
    try:
        result = run()
    except KeyboardInterrupt:
        if arguments.json:
            print(json.dumps({"paper": paper, "status": 130, "error": "interrupted"}), flush=True)
        raise
    if arguments.json:
        print(json.dumps(result._asdict(), ensure_ascii=False), flush=True)
    if result.status:
        _complain(result.error, result.status)
    return result


def _refresh(paper, output):
    """Put an executed notebook, cleaned, in the place of the committed one."""
    from tbdcore.repro import pages, products

    notebook = pages.clean(json.loads(output.read_text(encoding="utf-8")))
    text = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
    products.write(paths.NOTEBOOKS, {pages.path(paper).name: text.encode()})


def _values(paper, arguments):
    """The parameters of one notebook that the command line sets, checked, as its claims and its
    folder are.
    """
    from tbdcore.repro import claims, pages

    known = pages.parameters(paper)
    if paper in pages.papers():
        claims.read(paper)
    values = {}
    if arguments.quick:
        values |= {
            name: parameter.quick
            for name, parameter in known.items()
            if parameter.quick is not None
        }
        values["out"] = str(paths.BUILD / "quick")
    values |= {
        name: getattr(arguments, name)
        for name in ("workers", "scheduler", "out")
        if getattr(arguments, name) is not None
    }
    for text in arguments.given:
        name, equals, value = text.partition("=")
        if not equals:
            raise Fault(f"-p {text}: write -p name=value")
        values[name] = _value(value, known[name].type if name in known else "str")
    values = pages.validate(paper, values)
    changed = any(
        values[name] != known[name].default for name in values if name not in pages.PLUMBING
    )
    if changed and not values.get("out"):
        values["out"] = str(paths.BUILD / "run")
    paths.BUILD.mkdir(exist_ok=True)
    folder = pages.usable(values.get("out") or paths.figures())
    if changed and folder == paths.PRODUCTS.resolve():
        raise Fault(
            f"--out {values['out']}: the repository's figures are for default parameters; "
            f"give these another folder: build/try"
        )
    return values | {"out": str(folder)} if values.get("out") else values


def _value(text, kind):
    """A parameter from the command line: text for a str, a Python literal for everything else."""
    if kind == "str":
        return text
    try:
        value = ast.literal_eval(
            f"[{text}]"
            if kind == "list" and not text.startswith("[")
            else text.capitalize()
            if kind == "bool"
            else text
        )
    except (ValueError, SyntaxError):
        return text  # of the wrong type, as validate will say
    return value


def _reachable(jobs):
    """Raise unless the dask schedulers that some sets of parameters name answer."""
    from tbdcore.repro import trials

    for scheduler in {values.get("scheduler", "") for values in jobs} - {""}:
        try:
            trials.run(_nothing, 1, seed=0, scheduler=scheduler)
        except ConnectionError as error:
            raise Fault(error, ENVIRONMENT) from None


def _nothing(seed, i):
    return 0.0


def _score(arguments):
    """Write the scorecard and README's table and print them; fail when a claim is missing or its
    verdict has changed.

    figures/scorecard.csv holds every verdict, scorecard.md the counts, figures/README.md all
    products, figures.bib the papers.
    """
    from tbdcore.repro import cite, claims, products

    folder = _products_of(arguments)
    for paper in claims.papers():
        claims.read(paper)
    try:
        every, text = claims.ledger(folder), products.markdown(claims.scorecard(folder))
    except (ValueError, FileNotFoundError) as error:
        raise Fault(error, FAILED) from None
    files = {folder / "scorecard.csv": products.csv(every), folder / "scorecard.md": text.encode()}
    files |= {
        folder / "figures.bib": cite.bibliography().encode(),
        folder / "README.md": cite.gallery().encode(),
    }
    if not arguments.figures:
        files[paths.README] = _readme(every).encode()
    print(text, end="")
    changes = _changes(folder / "scorecard.csv", every)
    stale = [
        path.name
        for path, content in files.items()
        if not path.is_file() or path.read_bytes() != content
    ]
    if arguments.check and stale:
        raise Fault(f"{', '.join(stale)}: not what the verdicts say; run: tbdcore score", FAILED)
    for path, content in files.items():
        products.write(path.parent, {path.name: content})
    if changes:
        raise Fault(
            f"{len(changes)} verdicts are not those of the last scorecard: {'; '.join(changes)}",
            FAILED,
        )
    return GOOD


def _products_of(arguments):
    """The folder whose products are read: that of --figures, from here on for all modules."""
    if arguments.figures:
        os.environ["TBDCORE_FIGURES"] = arguments.figures
    return paths.figures()


def _cite(arguments):
    """What a report needs of a figure or table."""
    from tbdcore.repro import cite

    _products_of(arguments)
    print(cite.text(arguments.id, arguments.form), end="")
    return GOOD


def _which(arguments):
    """What a file is; fails when the sources that made it have changed."""
    from tbdcore.repro import cite

    text, current = cite.which(Path(arguments.file))
    print(text, end="")
    return GOOD if current else FAILED


def _doctor(arguments):
    """Check the environment: what is good on standard output, one line for each fault on standard
    error.
    """
    from tbdcore.repro import doctor

    status = GOOD
    for good, line in doctor.examine():
        if good:
            print(line, flush=True)
        else:
            status = _complain(line, ENVIRONMENT)
    return status


def _changes(scorecard, every):
    """The claims whose verdict is not the one in an earlier scorecard.csv."""
    import pandas as pd

    if not scorecard.is_file():
        return []
    key = ["paper", "id"]
    try:
        earlier = pd.read_csv(scorecard, dtype=str, keep_default_na=False)[[*key, "verdict"]]
    except (KeyError, pd.errors.ParserError, pd.errors.EmptyDataError):
        raise ValueError(
            f"{scorecard}: no scorecard; delete it, then make it anew: tbdcore score"
        ) from None
    both = every.merge(earlier, on=key, suffixes=("", "_old"))
    changed = both[both["verdict"] != both["verdict_old"]]
    return [
        f"{row.paper} {row.id} was {row.verdict_old}, is {row.verdict}"
        for row in changed.itertuples()
    ]


def _readme(every):
    """README.md with the table of papers between its markers made anew."""
    from tbdcore.repro import products

    begin, end = "<!-- scorecard -->\n", "<!-- /scorecard -->"
    before, _, rest = paths.README.read_text(encoding="utf-8").partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(
            f"README.md: the lines {begin.strip()} and {end} are missing; "
            f"the table of papers goes between them"
        )
    return f"{before}{begin}{products.markdown(_papers(every))}{end}{after}"


def _papers(every):
    """README's table: what came of each paper's numbers and statements; inputs are not results and
    are not counted.
    """
    import tomllib

    import pandas as pd

    from tbdcore.repro import claims, pages

    about = tomllib.loads(paths.BIBLIOGRAPHY.read_text(encoding="utf-8"))
    rows = []
    for paper in pages.papers():
        inputs = [claim.id for claim in claims.read(paper).values() if claim.kind == "input"]
        results = every[(every["paper"] == paper) & ~every["id"].isin(inputs)]
        counts = results["verdict"].value_counts()
        rest = ", ".join(
            f"{counts[verdict]} {verdict}" for verdict in claims.VERDICTS[1:4] if verdict in counts
        )
        title = f"{about[paper]['topic']} ({about[paper]['short']})"
        link = f"[{pages.path(paper).stem}](notebooks/{pages.path(paper).name})"
        rows.append(
            (
                title,
                link,
                f"{counts.get('reproduced', 0)} of {len(results)}",
                rest,
                about[paper].get("run_time", ""),
            )
        )
    return pd.DataFrame(rows, columns=["paper", "notebook", "reproduced", "the rest", "run time"])


if __name__ == "__main__":
    sys.exit(main())
