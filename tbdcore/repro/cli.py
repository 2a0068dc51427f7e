"""The command line: ``tbdcore run | sweep | score | cite | which | list | doctor | --version``.

Exit codes: 0 good, 1 a check failed, 2 bad usage or input, 3 the environment, 130 interrupted.  An
error is one line on standard error: what, where, what to do; ``--debug`` shows the traceback.

Here are its words, its errors and its exit codes; ``commands`` does what they say.  Little is
imported before the signals have their handlers.
"""

import argparse
import contextlib
import os
import re
import sys
import traceback

import tbdcore
from tbdcore.repro import paths, processes

GOOD, FAILED, USAGE, ENVIRONMENT, INTERRUPTED = 0, 1, 2, 3, 130
FORMS = {"bibtex": "entries of the paper and of this repository", "caption": "the caption alone"}
FORMS |= {"latex": "a complete figure or table environment", "markdown": "for Markdown"}


class CheckFailed(Exception):
    """What a check has found, in one line."""


CODES = {CheckFailed: FAILED, FileNotFoundError: USAGE, OSError: ENVIRONMENT, ValueError: USAGE}


def main(argv=None):
    """Entry point; returns the exit code.

    Without `argv` it is the command of this process: text that the terminal cannot show is
    escaped, and an interrupted command ends here, since a second signal while Python shuts down
    would end it with another code.
    """
    words = sys.argv[1:] if argv is None else argv
    if argv is None:
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(errors="backslashreplace")
    with processes.signals_to(processes.note):
        try:
            with processes.signals_to(processes.interrupt):
                code = _answer(words)
        except KeyboardInterrupt:
            code = INTERRUPTED
        if code == INTERRUPTED or processes.came:
            kept = "finished papers are kept, nothing is half written"
            code = report(f"interrupted; {kept}", INTERRUPTED)
            if argv is None:
                os._exit(code)
        processes.came.clear()
    return code


def _answer(words):
    """Execute a command and report its error; returns the exit code."""
    debug = "--debug" in words
    try:
        arguments = _parse(words)
        paths.root()
        from tbdcore.repro import commands  # --help does without

        with _folders(getattr(arguments, "figures", None)):
            return getattr(commands, arguments.function)(arguments)
    except BrokenPipeError:  # the reader of our output wants no more of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return GOOD
    except ModuleNotFoundError as error:
        extra = "this needs the extra repro: pip install 'tbdcore[repro]'"
        return report(f"{error.name} is missing; {extra}", ENVIRONMENT, debug)
    except Exception as error:
        for kind, code in CODES.items():
            if isinstance(error, kind):
                return report(error, code, debug)
        bug = f"{type(error).__name__}: {error}; this is a bug, --debug shows where"
        return report(bug, FAILED, debug)


def report(error, code, debug=False):
    """Print an error in one line, or its traceback; returns the exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        if debug and sys.exc_info()[0]:
            traceback.print_exc()
        else:
            print(f"tbdcore: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
    return code


@contextlib.contextmanager
def _folders(figures):
    """The folder of --figures is the one whose products are read; afterwards all are as before."""
    before = {name: os.environ.get(name, "") for name in ("TBDCORE_FIGURES", "TBDCORE_BUILD")}
    if figures is not None and not os.path.isdir(figures):
        raise ValueError(f"--figures {figures}: no such folder; give one that holds products")
    os.environ["TBDCORE_FIGURES"] = figures or before["TBDCORE_FIGURES"]
    try:
        yield
    finally:
        os.environ.update(before)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line with the nearest valid word."""

    def error(self, message):
        from tbdcore.repro.claims import nearest

        if wrong := re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message):
            near = nearest(wrong[1], re.findall(r"[a-z]+", wrong[2]))
            message = f"there is no command {wrong[1]!r}; the nearest is {near!r}"
        if (words := message.removeprefix("unrecognized arguments: ")) != message:
            near = nearest(words.split()[0], self._option_string_actions)
            near = f"; the nearest is {near}" if words[0] == "-" else ""
            message = f"{words}: not understood{near}"
        raise ValueError(f"{message}; see: {self.prog} --help")


def _parse(words):
    """The arguments; ValueError when a word is not known."""
    parser, parsers = _parsers()
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        parsers[arguments.name].error(f"unrecognized arguments: {' '.join(unknown)}")
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

    def command(name, function, help, *examples):
        epilog = "\n  ".join(["examples:", *(f"tbdcore {name} {words}" for words in examples)])
        own = group.add_parser(name, help=help, description=help, epilog=epilog.rstrip(), **look)
        own.set_defaults(function=function)
        own.add_argument("--debug", default=argparse.SUPPRESS, **debug)
        return own.add_argument

    paper = {"metavar": "PAPER", "help": "name, number or notebook, as tbdcore list shows them"}
    help = "execute notebooks; all if none is named"
    examples = ("", "track_cfar 01", "mda_tbd -p n_trials=20 -p seed=3", "--quick --resume")
    add = command("run", "run_papers", help, *examples)
    add("papers", nargs="*", **paper)
    _add_running(add, "folder for the products instead of figures/")
    add("--in-place", action="store_true", help="refresh the committed notebooks as well")

    help = "execute one notebook for each value of a parameter; tables of all verdicts"
    examples = ("track_cfar seed=1,2,3 --resume", "dp_tbd 'snr_db=[3,4];[5,6]' --quick")
    add = command("sweep", "sweep_parameter", help, *examples)
    add("paper", **paper)
    add("values", metavar="name=v1,v2,...", help="one parameter; between lists write ;")
    _add_running(add, "folder for tables and products, not build/sweep/PAPER")

    where = {"metavar": "DIR", "help": "folder with the products, instead of figures/"}
    help = "write the scorecard of all papers"
    add = command("score", "score_papers", help, "", "--check", "--figures build/run")
    add("--figures", **where)
    add("--check", action="store_true", help="write nothing; fail when a file is stale")

    help = "caption, files and BibTeX of a figure or table; without a name the ids of all"
    examples = ("", "track_cfar", "track_cfar/fig05 --latex", "dp_tbd --bibtex")
    add = command("cite", "cite_product", help, *examples)
    add("id", nargs="?", default="", metavar="PAPER[/NAME]", help="as tbdcore cite lists them")
    forms = group.choices["cite"].add_mutually_exclusive_group()
    for form, said in FORMS.items():
        forms.add_argument(f"--{form}", help=said, dest="form", action="store_const", const=form)
    add("--figures", **where)

    help = "what a file is, what made it, and whether that has changed since"
    examples = ("report/picture.pdf", "figures/track_cfar/fig05.csv")
    add = command("which", "identify_file", help, *examples)
    add("file", metavar="FILE", help="a product of tbdcore, wherever it is now")
    add("--figures", **where)

    help = "the papers; of one paper its parameters, figures and tables"
    add = command("list", "list_papers", help, "", "track_cfar")
    add("paper", nargs="?", **paper)
    add("--figures", **where)

    help = "whether this machine can run it all, with a self-test"
    command("doctor", "examine_machine", help, "")
    return parser, group.choices


def _add_running(add, out):
    """The options of run and sweep."""
    add("--out", metavar="DIR", help=out)
    given = {"dest": "given", "action": "append", "default": [], "metavar": "name=value"}
    add("-p", help="set a parameter; tbdcore list PAPER shows them", **given)
    add("--quick", action="store_true", help="few trials, into build/; never touches figures/")
    add("--workers", type=int, metavar="N", help="processes, 0 for one per core")
    add("--scheduler", metavar="ADDRESS", help="address of a dask scheduler")
    done = "skip what is done with the same sources and parameters"
    add("--resume", action="store_true", help=done)
    add("--json", action="store_true", help="one JSON object per run on standard output")


if __name__ == "__main__":
    from tbdcore.repro import cli  # the module that the commands import, not a second one

    sys.exit(cli.main())
