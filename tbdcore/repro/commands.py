"""What the commands do: each takes the arguments of the command line and returns an exit code."""

import ast
import contextlib
import json
import sys
import textwrap
from functools import partial
from pathlib import Path

from tbdcore.repro import (
    batch,
    changes,
    cite,
    claims,
    new,
    pages,
    paths,
    processes,
    products,
    trials,
)
from tbdcore.repro.exits import ENVIRONMENT, FAILED, GOOD, INTERRUPTED, CheckFailed, report


def run_command(arguments):
    """Execute some notebooks; one that fails does not stop the others."""
    named = arguments.papers or (pages.papers() if arguments.p else pages.notebooks())
    if arguments.in_place and (arguments.p or arguments.quick or arguments.out or arguments.resume):
        advice = "drop -p, --quick, --out and --resume"
        raise ValueError(f"--in-place executes the notebooks with their defaults; {advice}")
    _prepare(arguments)
    jobs = {paper: _values(paper, arguments) for paper in map(pages.paper_of, named)}
    _find_clusters([*jobs], jobs.values(), arguments)
    status, folder = GOOD, paths.build() / "quick" if arguments.quick else paths.build()
    for paper, values in jobs.items():
        processes.look(arguments.came)
        result = _run(paper, values, folder, arguments)
        if arguments.in_place and result.status == GOOD:
            output = Path(result.notebook)
            executed = json.loads(output.read_text(encoding="utf-8"))
            warning = pages.warned(executed)
            text = json.dumps(pages.clean(executed), indent=1, ensure_ascii=False) + "\n"
            products.write(paths.notebooks(), {output.name: text.encode()})
            if warning:
                status = max(status, report(f"{paper}: {warning}; mend it, run it again", FAILED))
        status = max(status, result.status)
    return status


def stamp_command(arguments):
    """Renew the stamps of some pages; one that does not come out again does not stop the others."""
    from tbdcore.repro import stamps

    papers, status = arguments.papers or pages.notebooks(), GOOD
    for paper in map(pages.paper_of, papers):
        processes.look(arguments.came)
        try:
            how = {"debug": arguments.debug, "came": arguments.came}
            renewed = stamps.renew(paper, how) if stamps.stale(paper) else []
            stamps.fly_again(paper, arguments.came)
            print(f"{paper}: {len(renewed)} stamps renewed" if renewed else f"{paper}: as they are")
        except CheckFailed as error:
            status = report(error, FAILED)
    return status


def sweep_command(arguments):
    """Execute one notebook for each value of a parameter, and put the verdicts into tables."""
    paper, runs = pages.paper_of(arguments.paper, pages.papers()), {}
    (name, _, text), parameters = arguments.values.partition("="), pages.parameters(paper)
    if not text:
        advice = "write the parameter and its values as name=v1,v2"
        raise ValueError(f"sweep {arguments.values}: {advice}")
    if name in pages.EXECUTION:
        raise ValueError(f"sweep {name}: it cannot change a result; sweep another parameter")
    _prepare(arguments)
    for value in text.split(";" if name in parameters and parameters[name].type == "list" else ","):
        values = _values(paper, arguments, f"{name}={value}")
        if any(values[name] == earlier[name] for earlier in runs.values()):
            raise ValueError(f"sweep {name}: {value} is given twice; give each value once")
        runs[value] = values
    _find_clusters([paper], runs.values(), arguments)
    folder = pages.usable(arguments.out) if arguments.out else paths.build() / "sweep" / paper
    status, done = GOOD, {}
    for number, (value, values) in enumerate(runs.items(), start=1):
        processes.look(arguments.came)
        arguments.say(f"{name} = {value} ({number} of {len(runs)})")
        place = folder / f"{name}={value}"
        result = _run(paper, values | {"out": str(place)}, place, arguments)
        if result.status == GOOD:
            done[value] = place
            batch.tabulate(paper, name, done, folder)
        status = max(status, result.status)
    if done:
        arguments.say(f"{paper}: tables in {folder / name}.csv and {name}_shares.csv")
    return status


def _prepare(arguments):
    """Lines of progress go to standard error where JSON goes to the other; where build/ cannot be
    written, a folder in that of --out takes its place.
    """
    arguments.say = partial(print, file=sys.stderr if arguments.json else sys.stdout, flush=True)
    closed = paths.build()
    if paths.writable(closed):
        return
    if not arguments.out:
        raise OSError(f"{closed} cannot be written; name a folder: --out DIR")
    build = str(pages.usable(arguments.out) / "build")
    arguments.until_end.enter_context(paths.moved(TBDCORE_BUILD=build))
    arguments.say(f"{closed} cannot be written; executed notebooks go to {paths.build()}")


def _run(paper, values, folder, arguments):
    """Execute a notebook into a folder and report; returns the result."""
    output = folder / pages.path(paper).name
    how = {name: getattr(arguments, name) for name in ("say", "resume", "debug", "came")}
    try:
        result = batch.execute(paper, values, output, **how)
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


def _values(paper, arguments, *more):
    """The parameters that the command line sets, checked with claims file and output folder."""
    parameters = pages.parameters(paper)
    if pages.has_ledger(paper):
        claims.read(paper)
    values = {}
    if arguments.quick:
        values = {name: one.quick for name, one in parameters.items() if one.quick is not None}
        values["out"] = str(paths.build() / "quick")
    given = {name: getattr(arguments, name) for name in pages.EXECUTION}
    given = {name: value for name, value in given.items() if value is not None}
    for text in (*arguments.p, *more):
        name, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"-p {text}: write -p name=value")
        if name in given:
            raise ValueError(f"parameter {name} is given twice; give it once")
        given[name] = _literal(value, parameters[name].type if name in parameters else "str")
    values = pages.validate(paper, values | given)
    if pages.changed(paper, values) and not values.get("out"):
        values["out"] = str(paths.build() / "run")
    paths.build().mkdir(exist_ok=True)
    folder = pages.destination(paper, values)
    return values | {"out": str(folder)} if values.get("out") else values


def _literal(text, kind):
    """The value that a text on the command line stands for; what is no literal stays text, of the
    wrong type for all but a str, as `pages.validate` will say.
    """
    if kind == "str":
        return text
    if text.lstrip("+-").lower() in ("nan", "inf"):
        return float(text)
    text = f"[{text}]" if kind == "list" and not text.startswith("[") else text
    text = text.capitalize() if kind == "bool" else text
    with contextlib.suppress(ValueError, SyntaxError, MemoryError, RecursionError):
        return ast.literal_eval(text)
    return text


def _find_clusters(papers, jobs, arguments):
    """Say what the dask clusters that some sets of parameters name have."""
    for address in {values.get("scheduler", "") for values in jobs} - {""}:
        connect = partial(trials.cluster, address, papers)
        workers, threads = processes.wait(connect, arguments.came)
        arguments.say(f"scheduler {address}: workers {workers}, threads {threads}")


def score_command(arguments):
    """Write the scorecard's files; fail when a claim is missing or its verdict has changed."""
    from tbdcore.repro import scorecard

    folder = paths.figures()
    for paper in claims.papers():
        claims.read(paper)
    try:
        every = claims.ledger(folder)
    except (ValueError, FileNotFoundError) as error:
        raise CheckFailed("; ".join([str(error), *_unlisted()])) from None
    files = scorecard.files(folder, readme=not arguments.figures)
    changed = scorecard.changes(folder)
    if not arguments.check:
        paths.require_writable(*{path.parent for path in files})
    stale = [path.name for path in files if not path.is_file() or path.read_bytes() != files[path]]
    print(files[folder / "scorecard.md"].decode(), end="")
    if arguments.check and stale:
        raise CheckFailed(f"{', '.join(stale)}: not what the verdicts say; run: tbdcore score")
    for path, content in files.items():
        products.write(path.parent, {path.name: content})
    if changed:
        count = f"{len(changed)} verdicts are not those of the last scorecard"
        raise CheckFailed(f"{count}: {'; '.join(changed)}")
    if faults := _unlisted(None if arguments.figures else every):
        raise CheckFailed("; ".join(faults))
    return GOOD


def _unlisted(every=None):
    """What the lists of changes and seeds leave out, in lines; prints where old values stand."""
    from tbdcore.repro import scorecard

    faults = changes.complaints(every)
    other = "seeds.csv has judged another value or rule; make it anew: python -m benchmarks.seeds"
    faults += [f"{other} {words}" for words in scorecard.stale()]
    if places := changes.copies():
        print(*places, sep="\n")
        faults.append(f"places with a value that was corrected, listed above: {len(places)}")
    return faults


def cite_command(arguments):
    """What a report needs of a figure or table; the ids of a paper's, or of all."""
    id, form = arguments.id, arguments.form
    _, slash, name = id.rpartition("/")
    if named := [each for each in cite.ids() if each.endswith(f"/{id}")]:
        raise ValueError(f"{id}: give one of {', '.join(named)}")
    if slash and not name.endswith(".ipynb"):
        print(cite.text(_id(id), form), end="")
        return GOOD
    paper = pages.paper_of(id) if id else ""
    if form and form != "bibtex":
        advice = "give the id of a figure or table; tbdcore cite lists them"
        raise ValueError(f"--{form} {id or 'without an id'}: {advice}")
    every = [paper] if paper else pages.notebooks()
    print(cite.entries(paper) if form else _captions(every), end="")
    return GOOD


def show_command(arguments):
    """Caption, data and verdicts of a figure or table."""
    if "/" not in arguments.id:
        advice = "give the id of a figure or table, as tbdcore cite lists them"
        raise ValueError(f"show {arguments.id}: {advice}")
    print(cite.shown(_id(arguments.id)), end="")
    return GOOD


def _id(text):
    """The id of a product, whose paper may be named by its number; `cite` names the nearest."""
    word, slash, name = text.rpartition("/")
    with contextlib.suppress(ValueError):
        word = pages.paper_of(word)
    return f"{word}{slash}{name}"


def _captions(papers):
    """Ids and captions of the products of some papers."""
    captions = {id: cite.product(id)["caption"] for paper in papers for id in cite.ids(paper)}
    if not captions:
        made = f"make them: tbdcore run {papers[0] if len(papers) == 1 else ''}"
        raise ValueError(f"{', '.join(papers)}: no products in {paths.figures()}; {made}")
    return "".join(f"{id}\n{_indented(text, 2)}\n" for id, text in captions.items())


def _indented(text, by):
    return textwrap.fill(text, 98, initial_indent=" " * by, subsequent_indent=" " * by)


def which_command(arguments):
    """What a file is; fails when the sources that made it have changed."""
    text, current = cite.which(Path(arguments.file))
    print(text, end="")
    return GOOD if current else FAILED


def list_command(arguments):
    """The papers; of one paper its parameters, and its products with captions."""
    cite.papers()  # complete
    if arguments.paper is None:
        for paper in pages.notebooks():
            print(f"{paper:<12}{pages.path(paper).name:<22}{cite.topic(paper)}")
        return GOOD
    paper = pages.paper_of(arguments.paper)
    print(f"{paper}: {cite.topic(paper)}, notebooks/{pages.path(paper).name}\n\nparameters")
    for one in pages.parameters(paper).values():
        quick = "" if one.quick is None else f"quick {one.quick}"
        limits = "; ".join(filter(None, (one.allowed(), quick)))
        print(f"  {one.name}: {one.type} = {json.dumps(one.default)}  {limits}".rstrip())
        print(_indented(one.meaning, 6))
    print("\nfigures and tables")
    made = _captions([paper]) if cite.ids(paper) else f"none in {paths.figures()}\n"
    print(textwrap.indent(made, "  "), end="")
    return GOOD


def new_command(arguments):
    """Write the files of a chapter to begin with."""
    for path in new.create(arguments.key):
        print(path.relative_to(paths.root()).as_posix())
    return GOOD


def doctor_command(arguments):
    """Check the environment; faults go to standard error, a line for each."""
    from tbdcore.repro import doctor

    status = GOOD
    for good, line in doctor.examine(arguments.came):
        if good:
            print(line, flush=True)
        else:
            status = report(line, ENVIRONMENT)
    return status
