"""What the commands do: each takes the arguments of the command line and returns an exit code."""

import ast
import contextlib
import json
import os
import sys
import textwrap
from functools import partial
from pathlib import Path

from tbdcore.repro import batch, cite, claims, pages, paths, products, trials
from tbdcore.repro.cli import ENVIRONMENT, FAILED, GOOD, INTERRUPTED, CheckFailed, report


def paper_of(word, known=None):
    """The paper that a word names: its key, its number, or its notebook (``dp_tbd``, ``01``,
    ``notebooks/01_dp_tbd.ipynb``).

    ValueError, with the nearest of the `known` ones, when it is none of these.
    """
    known, names = known or pages.notebooks(), {}
    for paper in known:
        stem = pages.path(paper).stem
        names |= dict.fromkeys((paper, stem, stem[:2], stem[:2].lstrip("0") or "0"), paper)
    if (name := Path(word).name.removesuffix(".ipynb")) in names:
        return names[name]
    near = f"the nearest is {claims.nearest(word, known)!r} of {', '.join(known)}"
    raise ValueError(f"paper {word!r}: there is no such notebook here; {near}")


def run_papers(arguments):
    """Execute some notebooks; one that fails does not stop the others."""
    named = arguments.papers or (pages.papers() if arguments.given else pages.notebooks())
    changed = arguments.given or arguments.quick or arguments.out or arguments.resume
    if arguments.in_place and changed:
        advice = "drop -p, --quick, --out and --resume"
        raise ValueError(f"--in-place executes the notebooks with their defaults; {advice}")
    _find_build(arguments)
    jobs = {paper: _values(paper, arguments) for paper in map(paper_of, named)}
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


def sweep_parameter(arguments):
    """Execute one notebook for each value of a parameter."""
    paper, (name, _, text) = arguments.paper, arguments.values.partition("=")
    paper, runs = paper_of(paper, pages.papers()), []
    known = pages.parameters(paper)
    if not text:
        given = arguments.values
        raise ValueError(f"sweep {given}: write the parameter and its values as name=v1,v2")
    if name in pages.EXECUTION:
        raise ValueError(f"sweep {name}: it cannot change a result; sweep another parameter")
    _find_build(arguments)
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
        _say(arguments, f"{paper}: tables in {folder / name}.csv and {name}_shares.csv")
    return max(ended)


def _say(arguments, text):
    """A line of progress, on standard error where JSON goes to the other."""
    print(text, file=sys.stderr if arguments.json else sys.stdout, flush=True)


def _options(arguments):
    """The options of a run."""
    say = partial(_say, arguments)
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
        report(result.error, result.status)
    return result


def _find_build(arguments):
    """Where build/ cannot be written, a folder in that of --out takes its place."""
    if paths.writable(paths.BUILD):
        return
    if not arguments.out:
        raise OSError(f"{paths.BUILD} cannot be written; name a folder: --out DIR")
    build, closed = pages.usable(arguments.out) / "build", paths.BUILD
    os.environ["TBDCORE_BUILD"] = str(build)
    _say(arguments, f"{closed} cannot be written; executed notebooks go to {build}")


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
        advice = "give these another folder: --out build/try"
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
        _say(arguments, f"scheduler {address}: workers {workers}, threads {threads}")


def score_papers(arguments):
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


def cite_product(arguments):
    """What a report needs of a figure or table; the ids of a paper's, or of all."""
    word, slash, name = arguments.id.rpartition("/")
    if named := [id for id in cite.ids() if id.endswith(f"/{arguments.id}")]:
        raise ValueError(f"{arguments.id}: give one of {', '.join(named)}")
    if slash and not name.endswith(".ipynb"):
        with contextlib.suppress(ValueError):  # cite names the nearest id
            word = paper_of(word)
        print(cite.text(f"{word}/{name}", arguments.form), end="")
        return GOOD
    paper = paper_of(arguments.id) if arguments.id else ""
    if arguments.form == "bibtex":
        print(cite.bibliography(paper), end="")
    elif arguments.form:
        advice = "give the id of a figure or table; tbdcore cite lists them"
        raise ValueError(f"--{arguments.form} {arguments.id or 'without an id'}: {advice}")
    else:
        print(_captions([paper] if paper else pages.notebooks()), end="")
    return GOOD


def _captions(papers):
    """Ids and captions of the products of some papers."""
    missing = [paper for paper in papers if not cite.ids(paper)]
    if missing == list(papers):
        made = f"make them: tbdcore run {papers[0] if len(papers) == 1 else ''}"
        raise ValueError(f"{', '.join(papers)}: no products in {paths.figures()}; {made}")
    captions = {id: textwrap.fill(cite.product(id)["caption"], 96) for id in cite.ids(*papers)}
    return "".join(f"{id}\n{textwrap.indent(captions[id], '  ')}\n" for id in captions)


def identify_file(arguments):
    """What a file is; fails when the sources that made it have changed."""
    text, current = cite.which(Path(arguments.file))
    print(text, end="")
    return GOOD if current else FAILED


def list_papers(arguments):
    """The papers; of one paper its parameters, and its products with captions."""
    cite.papers()  # complete
    if arguments.paper is None:
        for paper in pages.notebooks():
            print(f"{paper:<12}{pages.path(paper).name:<22}{cite.topic(paper)}")
        return GOOD
    paper = paper_of(arguments.paper)
    print(f"{paper}: {cite.topic(paper)}, notebooks/{pages.path(paper).name}\n\nparameters")
    for one in pages.parameters(paper).values():
        quick = "" if one.quick is None else f"quick {one.quick}"
        limits = "; ".join(filter(None, (one.allowed(), quick)))
        print(f"  {one.name}: {one.type} = {json.dumps(one.default)}  {limits}".rstrip())
        print(textwrap.indent(textwrap.fill(one.meaning, 92), "      "))
    print("\nfigures and tables")
    made = _captions([paper]) if cite.ids(paper) else f"none in {paths.figures()}\n"
    print(textwrap.indent(made, "  "), end="")
    return GOOD


def examine_machine(arguments):
    """Check the environment; faults go to standard error, a line for each."""
    from tbdcore.repro import doctor

    status = GOOD
    for good, line in doctor.examine():
        if good:
            print(line, flush=True)
        else:
            status = report(line, ENVIRONMENT)
    return status
