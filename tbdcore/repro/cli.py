"""The command line: ``tbdcore run | sweep | score | cite | which | list | doctor | --version``.

Exit codes: 0 good, 1 a check failed, 2 bad usage or input, 3 the environment, 130 interrupted.  An
error is one line on standard error: what, where, what to do; ``--debug`` shows the traceback.
"""

import argparse
import ast
import contextlib
import json
import os
import re
import signal
import sys
import textwrap
import traceback
from functools import partial
from pathlib import Path

import tbdcore
from tbdcore.repro import claims, paths, products

GOOD, FAILED, USAGE, ENVIRONMENT, INTERRUPTED = 0, 1, 2, 3, 130
FORMS = {"bibtex": "entries of the paper and of this repository", "caption": "the caption alone"}
FORMS |= {"latex": "a complete figure or table environment", "markdown": "for Markdown"}


class CheckFailed(Exception):
    """What a check has found, in one line."""


def main(argv=None):
    """Entry point; returns the exit code."""
    global batch, cite, pages, trials
    words = sys.argv[1:] if argv is None else argv
    report = partial(_report, debug="--debug" in words)
    try:
        with products.signals_to(signal.default_int_handler):
            arguments = _parse(words)
            paths.root()
            from tbdcore.repro import batch, cite, pages, trials  # --help does without

            with _figures(getattr(arguments, "figures", None)):
                return arguments.command(arguments)
    except CheckFailed as error:
        return report(error, FAILED)
    except ModuleNotFoundError as error:
        extra = "this needs the extra repro: pip install 'tbdcore[repro]'"
        return report(f"{error.name} is missing; {extra}", ENVIRONMENT)
    except BrokenPipeError:  # the reader of our output wants no more of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return GOOD
    except OSError as error:
        return report(error, USAGE if isinstance(error, FileNotFoundError) else ENVIRONMENT)
    except ValueError as error:
        return report(error, USAGE)
    except KeyboardInterrupt:
        kept = "finished papers are kept, nothing is half written"
        return report(f"interrupted; {kept}", INTERRUPTED)
    except Exception as error:
        bug = "this is a bug, --debug shows where"
        return report(f"{type(error).__name__}: {error}; {bug}", FAILED)


def _report(error, code, debug=False):
    """Print an error in one line, or its traceback; returns the exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        if debug and sys.exc_info()[0]:
            traceback.print_exc()
        else:
            print(f"tbdcore: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
    return code


@contextlib.contextmanager
def _figures(folder):
    """The folder of --figures is the one whose products are read."""
    before = os.environ.get("TBDCORE_FIGURES", "")
    if folder is not None and not Path(folder).is_dir():
        raise ValueError(f"--figures {folder}: no such folder; give one that holds products")
    os.environ["TBDCORE_FIGURES"] = before if folder is None else folder
    try:
        yield
    finally:
        os.environ["TBDCORE_FIGURES"] = before


# Words of the command line ---------------------------------------------------------------------


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line with the nearest valid word."""

    def error(self, message):
        if wrong := re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message):
            near = claims.nearest(wrong[1], re.findall(r"[a-z]+", wrong[2]))
            message = f"there is no command {wrong[1]!r}; the nearest is {near!r}"
        raise ValueError(f"{message}; see: {self.prog} --help")


def _parse(words):
    """The arguments; ValueError when a word is not known."""
    parser, parsers = _parsers()
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        own = parsers[arguments.name]
        known = [option for action in own._actions for option in action.option_strings]
        near = f"; the nearest is {claims.nearest(unknown[0], known)}"
        own.error(f"{' '.join(unknown)}: not understood{near if unknown[0][0] == '-' else ''}")
    return arguments


def _parsers():
    """The parser, and those of the commands by name."""
    look = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    debug = {"action": "store_true", "help": "show the traceback of an error"}
    about = "Run, score and cite the reproduction of five radar papers."
    after = "examples:\n  tbdcore list\n  tbdcore run track_cfar --quick\n  tbdcore cite"
    parser = _Parser(prog="tbdcore", description=about, epilog=after, **look)
    parser.add_argument("--version", action="version", version=f"tbdcore {tbdcore.__version__}")
    parser.add_argument("--debug", **debug)
    group = parser.add_subparsers(required=True, metavar="command", dest="name")

    def command(function, help, *examples):
        name = function.__name__.strip("_")
        epilog = "\n  ".join(["examples:", *(f"tbdcore {name} {words}" for words in examples)])
        own = group.add_parser(name, help=help, description=help, epilog=epilog.rstrip(), **look)
        own.set_defaults(command=function)
        own.add_argument("--debug", default=argparse.SUPPRESS, **debug)
        return own.add_argument

    examples = ("", "track_cfar dp_tbd", "mda_tbd -p n_trials=20 -p seed=3", "--quick --resume")
    add = command(_run, "execute notebooks; all if none is named", *examples)
    add("papers", nargs="*", metavar="PAPER")
    _add_running(add, "folder for the products instead of figures/")
    add("--in-place", action="store_true", help="refresh the committed notebooks as well")

    help = "execute one notebook for each value of a parameter; tables of all verdicts"
    examples = ("track_cfar seed=1,2,3 --resume", "dp_tbd 'snr_db=[3,4];[5,6]' --quick")
    add = command(_sweep, help, *examples)
    add("paper", metavar="PAPER")
    add("values", metavar="name=v1,v2,...", help="one parameter; between lists write ;")
    _add_running(add, "folder for tables and products, not build/sweep/PAPER")

    where = {"metavar": "DIR", "help": "folder with the products, instead of figures/"}
    add = command(_score, "write the scorecard of all papers", "", "--check", "--figures build/run")
    add("--figures", **where)
    add("--check", action="store_true", help="write nothing; fail when a file is stale")

    help = "caption, files and BibTeX of a figure or table; without a name the ids of all"
    add = command(_cite, help, "", "track_cfar", "track_cfar/fig05 --latex", "dp_tbd --bibtex")
    add("id", nargs="?", default="", metavar="PAPER[/NAME]", help="as tbdcore cite lists them")
    forms = group.choices["cite"].add_mutually_exclusive_group()
    for form, said in FORMS.items():
        forms.add_argument(f"--{form}", help=said, dest="form", action="store_const", const=form)
    add("--figures", **where)

    help = "what a file is, what made it, and whether that has changed since"
    add = command(_which, help, "report/picture.pdf", "figures/track_cfar/fig05.csv")
    add("file", metavar="FILE", help="a product of tbdcore, wherever it is now")
    add("--figures", **where)

    help = "the papers; of one paper its parameters, figures and tables"
    add = command(_list, help, "", "track_cfar")
    add("paper", nargs="?", metavar="PAPER")
    add("--figures", **where)

    command(_doctor, "whether this machine can run it all, with a self-test", "")
    return parser, group.choices


def _add_running(add, out):
    add("--out", metavar="DIR", help=out)
    given = {"dest": "given", "action": "append", "default": [], "metavar": "name=value"}
    add("-p", help="set a parameter; tbdcore list PAPER shows them", **given)
    add("--quick", action="store_true", help="few trials, into build/; never touches figures/")
    add("--workers", type=int, metavar="N", help="processes, 0 for one per core")
    add("--scheduler", metavar="ADDRESS", help="address of a dask scheduler")
    done = "skip what is done with the same sources and parameters"
    add("--resume", action="store_true", help=done)
    add("--json", action="store_true", help="one JSON object per run on standard output")


# Runs ------------------------------------------------------------------------------------------


def _run(arguments):
    """Execute some notebooks; one that fails does not stop the others."""
    named = arguments.papers or (pages.papers() if arguments.given else pages.notebooks())
    jobs = {paper: _values(paper, arguments) for paper in named}
    changed = arguments.given or arguments.quick or arguments.out or arguments.resume
    if arguments.in_place and changed:
        advice = "drop -p, --quick, --out and --resume"
        raise ValueError(f"--in-place executes the notebooks with their defaults; {advice}")
    _find_clusters(jobs.values(), arguments)
    folder = paths.BUILD / "quick" if arguments.quick else paths.BUILD
    status, options = GOOD, _options(arguments)
    for paper, values in jobs.items():
        output = folder / pages.path(paper).name
        result = _result(arguments, paper, partial(batch.run, paper, values, output, **options))
        if arguments.in_place and result.status == GOOD:
            notebook = pages.clean(json.loads(output.read_text(encoding="utf-8")))
            text = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
            products.write(paths.NOTEBOOKS, {output.name: text.encode()})
        status = max(status, result.status)
    return status


def _sweep(arguments):
    paper, (name, _, text) = arguments.paper, arguments.values.partition("=")
    known, runs, papers = pages.parameters(paper), [], pages.papers()
    if paper not in papers:
        raise ValueError(f"sweep {paper}: it has no verdicts; sweep one of {', '.join(papers)}")
    if not text:
        given = arguments.values
        raise ValueError(f"sweep {given}: write the parameter and its values as name=v1,v2")
    if name in pages.EXECUTION:
        raise ValueError(f"sweep {name}: it cannot change a result; sweep another parameter")
    for value in text.split(";" if name in known and known[name].type == "list" else ","):
        values = _values(paper, arguments, f"{name}={value}")
        if any(values[name] == earlier[name] for _, earlier in runs):
            raise ValueError(f"sweep {name}: {value} is given twice; give each value once")
        runs.append((value, values))
    _find_clusters([values for _, values in runs], arguments)
    folder = pages.usable(arguments.out) if arguments.out else paths.BUILD / "sweep" / paper
    results = batch.sweep(paper, name, runs, folder, **_options(arguments))
    ended = [_result(arguments, paper, partial(next, results)).status for _ in runs]
    if GOOD in ended:
        _options(arguments)["say"](f"{paper}: tables in {folder / name}.csv and {name}_shares.csv")
    return max(ended)


def _options(arguments):
    """The options of a run; lines of progress go to standard error where JSON goes to the other."""
    say = partial(print, file=sys.stderr if arguments.json else sys.stdout, flush=True)
    return {"say": say, "resume": arguments.resume, "debug": arguments.debug}


def _result(arguments, paper, run):
    """The result of a run, reported."""
    try:
        result = run()
    except KeyboardInterrupt:
        if arguments.json:
            ended = {"paper": paper, "status": INTERRUPTED, "error": "interrupted"}
            print(json.dumps(ended), flush=True)
        raise
    if arguments.json:
        print(json.dumps(result._asdict(), ensure_ascii=False), flush=True)
    if result.status:
        _report(result.error, result.status)
    return result


def _values(paper, arguments, *more):
    """The parameters that the command line sets, checked with claims file and output folder."""
    known = pages.parameters(paper)
    if pages.has_ledger(paper):
        claims.read(paper)
    values = {}
    if arguments.quick:
        values = {name: one.quick for name, one in known.items() if one.quick is not None}
        values["out"] = str(paths.BUILD / "quick")
    options = {name: getattr(arguments, name) for name in pages.EXECUTION}
    values |= {name: value for name, value in options.items() if value is not None}
    for text in (*arguments.given, *more):
        name, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"-p {text}: write -p name=value")
        values[name] = _value(value, known[name].type if name in known else "str")
    values = pages.validate(paper, values)
    settings = [name for name in values if name not in pages.EXECUTION]
    changed = any(values[name] != known[name].default for name in settings)
    if changed and not values.get("out"):
        values["out"] = str(paths.BUILD / "run")
    paths.BUILD.mkdir(exist_ok=True)
    folder = pages.usable(values.get("out") or paths.figures())
    if changed and folder == paths.PRODUCTS.resolve():
        advice = "give these another folder: build/try"
        raise ValueError(f"--out {values['out']}: {pages.ONLY_DEFAULTS}; {advice}")
    return values | {"out": str(folder)} if values.get("out") else values


def _value(text, kind):
    """A parameter from the command line: text for a str, a Python literal for everything else."""
    if kind == "str":
        return text
    if kind == "list" and not text.startswith("["):
        text = f"[{text}]"
    try:
        return ast.literal_eval(text.capitalize() if kind == "bool" else text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text  # of the wrong type, as validate will say


def _find_clusters(jobs, arguments):
    """Say what the dask clusters that some sets of parameters name have."""
    for address in {values.get("scheduler", "") for values in jobs} - {""}:
        workers, threads = trials.cluster(address)
        _options(arguments)["say"](f"scheduler {address}: workers {workers}, threads {threads}")


# Products --------------------------------------------------------------------------------------


def _score(arguments):
    """Write the scorecard's files; fail when a claim is missing or its verdict has changed."""
    from tbdcore.repro import scorecard

    folder = paths.figures()
    for paper in claims.papers():
        claims.read(paper)
    try:
        claims.ledger(folder)
    except (ValueError, FileNotFoundError) as error:
        raise CheckFailed(error) from None
    files = scorecard.files(folder, readme=not arguments.figures)
    changes = scorecard.changes(folder)
    stale = [path.name for path in files if not path.is_file() or path.read_bytes() != files[path]]
    print(files[folder / "scorecard.md"].decode(), end="")
    if arguments.check and stale:
        raise CheckFailed(f"{', '.join(stale)}: not what the verdicts say; run: tbdcore score")
    for path, content in files.items():
        products.write(path.parent, {path.name: content})
    if changes:
        count = f"{len(changes)} verdicts are not those of the last scorecard"
        raise CheckFailed(f"{count}: {'; '.join(changes)}")
    return GOOD


def _cite(arguments):
    """What a report needs of a figure or table; the ids of a paper's, or of all."""
    if "/" in arguments.id:
        print(cite.text(arguments.id, arguments.form), end="")
    elif arguments.form == "bibtex":
        print(cite.bibliography(arguments.id), end="")
    elif arguments.form:
        advice = "give the id of a figure or table; tbdcore cite lists them"
        raise ValueError(f"--{arguments.form} {arguments.id or 'without an id'}: {advice}")
    elif named := [id for id in cite.ids() if id.endswith(f"/{arguments.id}")]:
        raise ValueError(f"{arguments.id}: give one of {', '.join(named)}")
    else:
        print(_captions([arguments.id] if arguments.id else pages.notebooks()), end="")
    return GOOD


def _captions(papers):
    """Ids and captions of the products of some papers."""
    missing = [paper for paper in papers if pages.path(paper) and not cite.ids(paper)]
    if missing == list(papers):
        made = f"make them: tbdcore run {papers[0] if len(papers) == 1 else ''}"
        raise ValueError(f"{', '.join(papers)}: no products in {paths.figures()}; {made}")
    captions = {id: textwrap.fill(cite.product(id)["caption"], 96) for id in cite.ids(*papers)}
    return "".join(f"{id}\n{textwrap.indent(captions[id], '  ')}\n" for id in captions)


def _which(arguments):
    """What a file is; fails when the sources that made it have changed."""
    text, current = cite.which(Path(arguments.file))
    print(text, end="")
    return GOOD if current else FAILED


def _list(arguments):
    """The papers; of one paper its parameters, and its products with captions."""
    cite.papers()  # complete
    if arguments.paper is None:
        for paper in pages.notebooks():
            print(f"{paper:<12}{pages.path(paper).name:<22}{cite.topic(paper)}")
        return GOOD
    paper, notebook = arguments.paper, pages.path(arguments.paper).name
    print(f"{paper}: {cite.topic(paper)}, notebooks/{notebook}\n\nparameters")
    for one in pages.parameters(paper).values():
        quick = "" if one.quick is None else f"quick {one.quick}"
        limits = "; ".join(filter(None, (one.allowed(), quick)))
        print(f"  {one.name}: {one.type} = {json.dumps(one.default)}  {limits}".rstrip())
        print(textwrap.indent(textwrap.fill(one.meaning, 92), "      "))
    print("\nfigures and tables")
    made = _captions([paper]) if cite.ids(paper) else f"none in {paths.figures()}\n"
    print(textwrap.indent(made, "  "), end="")
    return GOOD


def _doctor(arguments):
    """Check the environment; faults go to standard error, a line for each."""
    from tbdcore.repro import doctor

    status = GOOD
    for good, line in doctor.examine():
        if good:
            print(line, flush=True)
        else:
            status = _report(line, ENVIRONMENT)
    return status


if __name__ == "__main__":
    sys.exit(main())
