"""What may import what, what may lie where, and what no committed file may contain."""

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tbdcore.repro import pages, paths

FOLDERS = {
    ".ci",
    ".github",
    "benchmarks",
    "data",
    "docs",
    "figures",
    "notebooks",
    "tbdcore",
    "tests",
}
FILES = {
    ".gitattributes",
    ".gitignore",
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE",
    "LICENSE-TEXT",
    "Makefile",
    "README.md",
    "README.zh.md",
    "environment.txt",
    "pyproject.toml",
}
NUMBERS = {"numpy", "scipy", "numba"}
HARNESS = sorted(path.stem for path in (paths.PACKAGE / "repro").glob("*.py"))
CORE = sorted(
    path.relative_to(paths.PACKAGE).with_suffix("").as_posix()
    for path in paths.PACKAGE.rglob("*.py")
    if path.stem != "__main__" and path.parent.name != "repro"
)
MODULES = [*CORE, *(f"repro/{module}" for module in HARNESS)]


def dotted(module):
    """The name by which a module is imported."""
    return f"tbdcore.{module}".replace("/", ".").removesuffix(".__init__")


def imports(module):
    """Packages that a module imports, and the modules of this package among them, wherever in the
    file.
    """
    return imports_of((paths.PACKAGE / f"{module}.py").read_text(encoding="utf-8"))


def imports_of(text):
    """Packages that a source imports, and the modules of this package among them."""
    packages, own = set(), set()
    for node in ast.walk(ast.parse(text)):
        names = (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import | ast.ImportFrom)
            else []
        )
        if isinstance(node, ast.ImportFrom):
            names = [node.module, *(f"{node.module}.{name}" for name in names)]
        packages |= {name.partition(".")[0] for name in names}
        own |= {
            name.removeprefix("tbdcore").lstrip(".").replace(".", "/")
            for name in names
            if name.startswith("tbdcore")
        }
    return packages - {"tbdcore"}, {
        name for name in own if (paths.PACKAGE / f"{name}.py").is_file()
    } | {f"{name}/__init__" for name in own if name and (paths.PACKAGE / name).is_dir()}


def tracked():
    """The committed files, as they are in the working tree."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=paths.root(), capture_output=True, text=True
    )
    if listed.returncode:
        pytest.skip("no git repository here: nothing lists the committed files")
    return [
        paths.root() / name
        for name in listed.stdout.split("\0")
        if name and (paths.root() / name).is_file()
    ]


@pytest.mark.parametrize("module", CORE)
def test_the_core_imports_numbers_only(module):
    packages, own = imports(module)
    assert packages <= {*NUMBERS, *sys.stdlib_module_names}
    harness = {name for name in own if name.startswith("repro/")}
    assert harness <= (
        {"repro/__init__", "repro/pages", "repro/paths", "repro/publish"}
        if module == "__init__"
        else set()
    ), "only begin and page load the harness, when called"


@pytest.mark.parametrize("module", HARNESS)
def test_the_harness_imports_no_physics(module):
    packages, own = imports(f"repro/{module}")
    known = {name for name in own if not name.startswith("repro/")}
    assert known <= {"score"} or module == "doctor"  # its self-test runs a kernel
    if module != "figures":
        assert "matplotlib" not in packages, "only figures draws"


ROOMS = {"": 0, "kernels": 1, "recording": 1}  # a module imports none of a later or another room


@pytest.mark.parametrize("module", [module for module in CORE if module != "__init__"])
def test_imports_go_downwards(module):
    room = module.rpartition("/")[0]
    for name in imports(module)[1] - {"__init__"}:
        other = name.rpartition("/")[0]
        assert other == room or ROOMS[other] < ROOMS[room], f"{module} imports {name}"


@pytest.mark.parametrize("paper", pages.papers())
def test_an_algorithm_imports_nothing_of_the_harness(paper):
    text = "\n".join(pages.cells(paper, "algorithm"))
    packages, own = imports_of(text)
    assert packages <= {*NUMBERS, *sys.stdlib_module_names}
    assert own <= set(CORE)


def test_importing_a_numerical_module_does_not_load_the_harness():
    loaded = "name for name in sys.modules if name.split('.')[0] in ('matplotlib', 'pandas')"
    code = f"import sys, tbdcore.kalman; print(sorted({loaded}))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"


@pytest.mark.parametrize("module", MODULES)
def test_one_decorator_and_no_hidden_randomness(module):
    source = (paths.PACKAGE / f"{module}.py").read_text(encoding="utf-8")
    if module != "jit":
        assert not re.search(r"\bn?jit\(|@n?jit\b|\bprange\(|fastmath\s*=", source), (
            "tbdcore.kernel is the one decorator"
        )
    assert not re.search(r"default_rng\(|np\.random\.(seed|normal|uniform|rand)\b", source), (
        "a generator is an argument"
    )


@pytest.mark.parametrize("module", [module for module in CORE if not module.endswith("__init__")])
def test_a_kernel_calls_kernels_of_its_own_module_only(module):
    # Numba's disk cache goes by the caller's file: it would keep the old code of another module.
    names = vars(importlib.import_module(dotted(module)))
    kernels = [value.py_func for value in names.values() if hasattr(value, "py_func")]
    for function in kernels:
        for used in (names[name] for name in function.__code__.co_names if name in names):
            home = getattr(
                getattr(used, "py_func", None), "__module__", getattr(used, "__name__", "")
            )
            assert not home.startswith("tbdcore") or home == function.__module__


def kernels_within(names):
    """All Python functions that are compiled in a namespace, those in closures too."""
    found = {}
    for function in (value.py_func for value in names.values() if hasattr(value, "py_func")):
        held = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        found |= {id(function): function}
        found |= kernels_within({name: cell.cell_contents for name, cell in held})
    return found


@pytest.mark.parametrize("module", [module for module in CORE if not module.endswith("__init__")])
def test_no_two_kernels_share_a_name(module):
    # Numba links what it has cached by name and a running number, which two processes count alike:
    # of two kernels of one name, the second would silently run the first one's code.
    names = vars(importlib.import_module(dotted(module)))
    kernels = [kernel.__qualname__ for kernel in kernels_within(names).values()]
    assert len(set(kernels)) == len(kernels)


@pytest.mark.parametrize("module", MODULES)
def test_every_module_opens_with_a_docstring(module):
    assert ast.get_docstring(
        ast.parse((paths.PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
    )


def test_every_path_is_written_in_one_module():
    for module in set(MODULES) - {"repro/paths"}:
        source = (paths.PACKAGE / f"{module}.py").read_text(encoding="utf-8")
        assert not re.search(r"parents\[|Path\(__file__\)", source), module


def test_the_top_level_holds_what_the_readme_lists():
    assert {path.relative_to(paths.root()).parts[0] for path in tracked()} <= FOLDERS | FILES


def test_every_folder_explains_itself():
    for folder in FOLDERS - {
        ".ci",
        ".github",
        "tbdcore",
    }:  # scripts with a heading each; a package with a docstring
        assert (paths.root() / folder / "README.md").is_file(), folder


# Written in pieces, so that this file does not hold them itself.
PRIVATE = [
    r"/(?:root|home|Users)/\w",
    "/wo" + "rk/",
    "/tm" + "p/tbd",
    "/opt/" + r"\w",
    r"\bC:[\\]",
    "index-" + "url http",
    "find-" + "links",
]
HOSTS = [
    r"pypi\." + "org",
    r"files\.python" + "hosted",
    r"https?://[^/\s\"']*(?:artifactory|nexus|devpi|mirror)",
]


def test_no_committed_file_knows_a_machine_or_a_registry():
    found = re.compile("|".join(PRIVATE + HOSTS))
    for path in tracked():
        if path.suffix in (".png", ".pdf", ".gif"):
            # the bytes of pictures hold anything; their metadata is tested in test_figures
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            assert not found.search(line), (
                f"{path.relative_to(paths.root())}, line {number}: {found.search(line)[0]}"
            )


def test_the_lock_pins_everything_with_hashes():
    text = paths.lock().read_text(encoding="utf-8")
    entries = re.split(r"\n(?=[A-Za-z0-9])", text.strip())
    for entry in entries:
        name = entry.split()[0]
        assert re.fullmatch(r"[A-Za-z0-9_.\-]+==[^\s;]+", name), name
        assert "--hash=sha256:" in entry, name


def test_the_lock_holds_every_dependency():
    project = tomllib.loads((paths.root() / "pyproject.toml").read_text(encoding="utf-8"))
    extras = [
        names
        for extra, names in project["project"]["optional-dependencies"].items()
        if extra != "peers"
    ]
    wanted = [
        *project["project"]["dependencies"],
        *(name for extra in extras for name in extra),
        *project["build-system"]["requires"],
    ]
    locked = set(
        re.findall(
            r"^([A-Za-z0-9_.\-]+)==", paths.lock().read_text(encoding="utf-8"), flags=re.MULTILINE
        )
    )
    names = {re.match(r"[A-Za-z0-9_.\-]+", name)[0].lower().replace("_", "-") for name in wanted}
    assert names <= {name.lower().replace("_", "-") for name in locked}


def test_the_layout_names_every_module():
    text = (paths.root() / "docs" / "running.md").read_text(encoding="utf-8")
    for module in {Path(module).name for module in [*CORE, *HARNESS]} - {"__init__", "paths"}:
        assert re.search(rf"\b{module}\b", text), module


def test_every_link_of_the_readme_leads_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", paths.readme().read_text(encoding="utf-8")):
        assert target.startswith("https://") or (paths.root() / target).exists(), target
