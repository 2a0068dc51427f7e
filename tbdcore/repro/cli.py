"""The command line: its words, its errors and its exit codes; ``commands`` does what they say.

Exit codes: 0 good, 1 a check failed, 2 bad usage or input, 3 the environment, 130 interrupted.  An
error is one line on standard error: what, where, what to do; ``--debug`` shows the traceback.
Little is imported before the signals have their handlers.
"""

import argparse
import contextlib
import os
import sys

import tbdcore
from tbdcore.repro import paths, processes
from tbdcore.repro.exits import ENVIRONMENT, FAILED, GOOD, INTERRUPTED, USAGE, CheckFailed, report

PAPER = {"metavar": "PAPER", "help": "name, number or notebook, as tbdcore list shows them"}
ID = {"metavar": "PAPER[/NAME]", "help": "as tbdcore cite has it"}
FLAG = {"action": "store_true"}
TEXTS = {"action": "append", "default": []}
FORM = {"action": "store_const", "dest": "form"}
OPTIONS = {
    "papers": PAPER | {"nargs": "*"},
    "paper": PAPER,
    "[paper]": PAPER | {"nargs": "?"},
    "values": {"metavar": "name=v1,v2,...", "help": "one parameter; between lists write ;"},
    "id": ID,
    "[id]": ID | {"nargs": "?", "default": ""},
    "key": {"metavar": "NAME", "help": "of the new paper: small letters, digits, underscores"},
    "file": {"metavar": "FILE", "help": "a product of tbdcore, wherever it is now"},
    "--out": {"metavar": "DIR", "help": "folder for the products, instead of figures/ or build/"},
    "-p": TEXTS | {"metavar": "name=value", "help": "a parameter; tbdcore list PAPER shows all"},
    "--quick": FLAG | {"help": "few trials, into build/; never touches figures/"},
    "--workers": {"type": int, "metavar": "N", "help": "processes, 0 for one per core"},
    "--scheduler": {"metavar": "ADDRESS", "help": "address of a dask scheduler"},
    "--resume": FLAG | {"help": "skip what is done with the same sources and parameters"},
    "--json": FLAG | {"help": "one JSON object per run on standard output"},
    "--in-place": FLAG | {"help": "refresh the committed notebooks as well"},
    "--check": FLAG | {"help": "write nothing; fail when a file is stale"},
    "--figures": {"metavar": "DIR", "help": "folder with the products, instead of figures/"},
    "--bibtex": FORM | {"const": "bibtex", "help": "entries of the paper and of this repository"},
    "--caption": FORM | {"const": "caption", "help": "the caption alone"},
    "--latex": FORM | {"const": "latex", "help": "a complete figure or table environment"},
    "--markdown": FORM | {"const": "markdown", "help": "for Markdown"},
    "--debug": FLAG | {"default": argparse.SUPPRESS, "help": "show the traceback of an error"},
}
CITING = "[id] --figures --bibtex|--caption|--latex|--markdown"
RUNNING = "--out -p --quick --workers --scheduler --resume --json"
COMMANDS = {  # what it does, its options; of a|b at most one
    "run": ("execute notebooks; all if none is named", f"papers {RUNNING} --in-place"),
    "sweep": ("execute one notebook for each value of a parameter", f"paper values {RUNNING}"),
    "stamp": ("renew the digests of products that a run makes again as they are", "papers"),
    "score": ("write the scorecard of all papers", "--figures --check"),
    "cite": ("caption, files and BibTeX of a product; without an id all ids", CITING),
    "which": ("what a file is, what made it, what has changed since", "file --figures"),
    "show": ("caption, data and verdicts of a figure or table", "id --figures"),
    "list": ("the papers; of one paper its parameters and products", "[paper] --figures"),
    "new": ("begin a chapter with the example of docs/add_a_paper.md", "key"),
    "doctor": ("whether this machine can run it all, with a self-test", ""),
}
EXAMPLES = {
    "run": ["", "track_cfar 01", "mda_tbd -p n_trials=20 -p seed=3", "--quick --resume"],
    "sweep": ["track_cfar seed=1,2,3 --resume", "dp_tbd 'snr_db=[3,4];[5,6]' --quick"],
    "stamp": ["", "track_cfar 01"],
    "score": ["", "--check", "--figures build/run"],
    "cite": ["", "track_cfar", "track_cfar/fig05 --latex", "dp_tbd --bibtex"],
    "which": ["report/picture.pdf", "figures/track_cfar/fig05.csv"],
    "show": ["track_cfar/fig05"],
    "list": ["", "track_cfar"],
    "new": ["square_law"],
    "doctor": [""],
}


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
    with processes.signals_noted() as came:
        try:
            code = _answer(words, came)
        except KeyboardInterrupt:
            code = INTERRUPTED
        if came or code == INTERRUPTED:
            kept = "finished papers are kept, nothing is half written"
            code = report(f"interrupted; {kept}", INTERRUPTED)
            if argv is None:
                os._exit(code)
    return code


def _answer(words, came):
    """Execute a command, which looks at the signals that came, and report its error; returns the
    exit code.
    """
    debug = "--debug" in words
    try:
        arguments = _parse(words)
        arguments.came = came
        paths.root()
        from tbdcore.repro import commands  # --help does without

        processes.look(came)
        with contextlib.ExitStack() as arguments.until_end:
            if folder := getattr(arguments, "figures", None):
                arguments.until_end.enter_context(paths.moved(TBDCORE_FIGURES=_existing(folder)))
            return getattr(commands, f"{arguments.name}_command")(arguments)
    except BrokenPipeError:  # the reader of our output wants no more of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return GOOD
    except ModuleNotFoundError as error:
        extra = "cluster" if error.name == "distributed" else "repro"
        advice = f"this needs the extra {extra}: pip install 'tbdcore[{extra}]'"
        return report(f"{error.name} is missing; {advice}", ENVIRONMENT, debug)
    except Exception as error:
        code = next((code for kind, code in CODES.items() if isinstance(error, kind)), None)
        bug = f"{type(error).__name__}: {error}; this is a bug, --debug shows where"
        return report(error if code else bug, code or FAILED, debug)


def _existing(figures):
    """The folder of --figures; ValueError when there is none."""
    if not os.path.isdir(figures):
        raise ValueError(f"--figures {figures}: no such folder; give one that holds products")
    return figures


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, with the nearest valid word to one that is not known."""

    def error(self, message, word="", words=()):
        if word:
            from tbdcore.repro.claims import nearest

            message = f"{message}; the nearest is {nearest(word, words)}"
        raise ValueError(f"{message}; see: {self.prog} --help")


def _parse(words):
    """The arguments; ValueError when a word is not known."""
    look = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    about = "Run, score and cite the reproduction of five radar papers."
    after = "examples:\n  tbdcore list\n  tbdcore run track_cfar --quick\n  tbdcore cite"
    parser = _Parser(prog="tbdcore", description=about, epilog=after, **look)
    parser.add_argument("--version", action="version", version=f"tbdcore {tbdcore.__version__}")
    parser.add_argument("--debug", **OPTIONS["--debug"])
    parser.set_defaults(debug=False)
    group = parser.add_subparsers(required=True, metavar="command", dest="name")
    for name, (help, options) in COMMANDS.items():
        examples = "".join(f"\n  tbdcore {name} {words}".rstrip(" ") for words in EXAMPLES[name])
        after = f"examples:{examples}"
        own = group.add_parser(name, help=help, description=help, epilog=after, **look)
        own.set_defaults(parser=own)
        for choice in (*options.split(), "--debug"):
            place = own.add_mutually_exclusive_group() if "|" in choice else own
            for option in choice.split("|"):
                place.add_argument(option.strip("[]"), **OPTIONS[option])
    command = next((word for word in words if not word.startswith("-")), "run")
    if command not in COMMANDS:
        parser.error(f"there is no command {command!r}", command, map(repr, COMMANDS))
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        options = arguments.parser._option_string_actions if unknown[0].startswith("-") else ()
        message = f"{' '.join(unknown)}: not understood"
        arguments.parser.error(message, unknown[0] if options else "", options)
    return arguments


if __name__ == "__main__":
    from tbdcore.repro import cli  # the module that the commands import, not a second one

    sys.exit(cli.main())
