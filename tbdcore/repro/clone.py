"""Where this clone comes from: its address and commit, as far as git knows them.

Nothing that is committed depends on them: the same products come from every clone.  What is given
to others has them: BibTeX entries, the book, and the wheel that ``python -m tbdcore.repro.clone``
builds into ``build/dist``.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from tbdcore.repro import paths


class Clone(NamedTuple):
    """What may be said of the origin of these files, and what keeps the rest from being said."""

    address: str = ""  # of a page for the browser; empty if none is known
    commit: str = ""  # twelve digits, "with changes" if files have changed since; or empty
    missing: tuple = ()  # a line for each thing that is not known, or not sure


def find():
    """Address and commit of the repository, from the remote and the HEAD of its clone."""
    try:
        top = _git("rev-parse", "--show-toplevel")
    except FileNotFoundError:
        return Clone(missing=("no address and no commit: git is not installed",))
    if not top or not os.path.samefile(top, paths.root()):
        return Clone(missing=("no address and no commit: this folder is no git clone",))
    commit, said = _git("rev-parse", "--verify", "-q", "HEAD")[:12], []
    changed = False
    if not commit:
        said.append("no commit: this clone has none yet")
    elif changed := bool(_git("status", "--porcelain", "--untracked-files=no")):
        said.append("files have changed since this commit: commit them, then cite again")
    names = _git("remote").split()
    name = "origin" if "origin" in names else "".join(names[:1])
    address = browsable(_git("remote", "get-url", name)) if name else ""
    if not name:
        said.append("no address: this clone has no remote (git remote add origin ADDRESS)")
    elif not address:
        said.append(f"no address: the remote {name} is no address on the network")
    elif commit and not _git("branch", "-r", "--contains", "HEAD"):
        said.append("no branch of the remote known here has this commit: push it")
    return Clone(address, f"{commit} with changes" if changed else commit, tuple(said))


def browsable(remote):
    """The page of a remote, without name and password: git@host:a/b.git is https://host/a/b."""
    own = r"(?:[^@/]*@)?([\w.-]+\.\w+)"  # a name, perhaps; the host
    if parts := re.fullmatch(rf"(https?)://{own}(:\d+)?/(.+)", remote):
        scheme, host, port, path = parts.groups(default="")
    elif parts := re.fullmatch(rf"(?:(?:ssh|git)://{own}(?::\d+)?/|{own}:)(?!//)(.+)", remote):
        scheme, host, port, path = "https", parts[1] or parts[2], "", parts[3]
    else:
        return ""
    return f"{scheme}://{host}{port}/{path.strip('/').removesuffix('.git')}"


def citation(text, origin):
    """The text of CITATION.cff with address and commit, as far as they are known."""
    has = text.rstrip("\n").split("\n")
    new = {"repository-code": origin.address, "commit": origin.commit}
    new = {key: value for key, value in new.items() if not re.search(rf"(?m)^{key}:", text)}
    return "\n".join([*has, *(f'{key}: "{value}"' for key, value in new.items() if value), ""])


def project(text, origin):
    """The text of pyproject.toml with the address as the project's URL, if it is known."""
    if not origin.address or re.search(r"(?m)^\[project\.urls\]", text):
        return text
    return f'{text}\n[project.urls]\nSource = "{origin.address}"\n'


def build(folder):
    """Build a wheel and a source distribution that name the address; returns their files."""
    origin, parts = find(), {"CITATION.cff": citation, "pyproject.toml": project}
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        for name in ("tbdcore", "tests/kernels"):
            unwanted = shutil.ignore_patterns("__pycache__")
            shutil.copytree(paths.root() / name, Path(work, name), ignore=unwanted)
        for name in ("README.md", "LICENSE", "LICENSE-TEXT"):
            shutil.copy(paths.root() / name, work)
        for name, change in parts.items():
            text = (paths.root() / name).read_text(encoding="utf-8")
            Path(work, name).write_text(change(text, origin), encoding="utf-8")
        code = "import sys; from flit_core import buildapi; "
        code += "print(*(f(sys.argv[1]) for f in (buildapi.build_wheel, buildapi.build_sdist)))"
        command = [sys.executable, "-c", code, str(folder)]
        made = subprocess.run(command, cwd=work, capture_output=True, text=True, check=True)
    return [folder / name for name in made.stdout.split()], origin


def _git(*words):
    """What git prints for the repository, empty when it fails; FileNotFoundError without git."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    own |= {"GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    command = ["git", "-C", str(paths.root()), *words]
    done = subprocess.run(command, env=own, capture_output=True, text=True, errors="replace")
    return "" if done.returncode else done.stdout.strip()


if __name__ == "__main__":
    made, origin = build(paths.build() / "dist")
    for line in origin.missing:
        print(f"clone: {line}", file=sys.stderr)
    print(*(file.relative_to(paths.root()) for file in made), sep="\n")
