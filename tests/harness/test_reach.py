"""Which definitions code reaches by name, and what of them counts: planted changes, one by one."""

import ast
import sys
import textwrap
import types

import cloudpickle
import pytest

from tbdcore.repro import pages, paths, reach

INIT = """
def __getattr__(name):
    return name
"""
MODULES = {  # a package of its own, with a module below another
    "__init__": INIT,
    "jit": "def kernel(function):\n    return function\n",
    "motion": """
        import math
        from functools import cache

        from tbdcore.jit import kernel

        STEP = 2.0
        SPARE = 3.0
        TABLE = {"a": 1}
        TABLE["b"] = 2


        @kernel
        def transition(T):
            # a remark
            if T < 0:
                raise ValueError(f"T is {T}")
            return _inner(T) + STEP


        def _inner(T):
            print(f"{T:.2f}")
            return math.sqrt(T)


        class Track:
            width = STEP

            def follow(self):
                return hidden()


        def hidden():
            return 4


        def unused(known):
            return SPARE
    """,
    "deep/__init__": "from . import below\n",
    "deep/below": "def far(x):\n    return x + 1\n\n\ndef near(x):\n    return x - 1\n",
}
USES = {  # code that reaches `transition`, in each way that Python has
    "from import": "from tbdcore.motion import transition as f\n\nf(1)",
    "module": "from tbdcore import motion\n\nmotion.transition(1)",
    "alias": "from tbdcore import motion as m\n\nm.transition(1)",
    "chain": "import tbdcore\n\ntbdcore.motion.transition(1)",
    "inside": "def f():\n    from tbdcore import motion\n\n    return motion.transition(1)",
    "star": "from tbdcore.motion import *\n\ntransition(1)",
}
CHANGES = {  # texts of `motion`, what takes their place, and whether what is reached changes
    "a new function": ("def hidden", "def new(x):\n    return x\n\n\ndef hidden", False),
    "a new kernel": ("def hidden", "@kernel\ndef new(x):\n    return x\n\n\ndef hidden", False),
    "a new import": ("import math", "import math\nimport os", False),
    "an unused function": ("return SPARE", "return 2 * SPARE", False),
    "an unused constant": ("SPARE = 3.0", "SPARE = 5.0", False),
    "an unused class": ("return hidden()", "return -hidden()", False),
    "a comment": ("# a remark", "# another", False),
    "the text of an error": ("T is {T}", "T was {T}", False),
    "the function": ("+ STEP", "- STEP", True),
    "what it calls": ("math.sqrt(T)", "math.sqrt(T + 1)", True),
    "a constant": ("STEP = 2.0", "STEP = 2.5", True),
    "a printed format": ("{T:.2f}", "{T:.3f}", True),
    "its decorator": ("@kernel\n", "@cache\n", True),
    "the kind of an error": ("raise ValueError", "raise TypeError", True),
    "an import": ("import math", "import cmath as math", True),
    "what loading does": ('TABLE["b"] = 2', 'TABLE["b"] = 3', True),
    "a function that loading registers": (
        "def hidden",
        "@register\ndef new(x):\n    return x\n\n\ndef hidden",
        True,
    ),
}
TRANSITION = USES["module"]


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A folder with the package of MODULES; returns a function that writes one of them anew."""
    folder = tmp_path / "tbdcore"
    monkeypatch.setattr(paths, "PACKAGE", folder)

    def write(name, text):
        file = folder / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(textwrap.dedent(text), encoding="utf-8")

    for name, text in MODULES.items():
        write(name, text)
    return write


@pytest.mark.parametrize(("old", "new", "counts"), CHANGES.values(), ids=CHANGES)
def test_what_is_reached_counts_and_nothing_else(package, old, new, counts):
    before = reach.of_code(TRANSITION)
    assert old in MODULES["motion"]
    text = textwrap.dedent(MODULES["motion"])
    package("motion", text.replace(old, new))
    assert (reach.of_code(TRANSITION) != before) == counts


@pytest.mark.parametrize("code", USES.values(), ids=USES)
def test_a_name_is_followed_however_it_is_imported(package, code):
    before = reach.of_code(code)
    package("motion", MODULES["motion"].replace("+ STEP", "- STEP"))
    assert reach.of_code(code) != before
    package("motion", MODULES["motion"])
    package("jit", MODULES["jit"].replace("return function", "return (function, 1)"))
    assert reach.of_code(code)["tbdcore.jit"] != before["tbdcore.jit"]


@pytest.mark.parametrize(
    "code",
    [
        "from tbdcore import motion\n\nf = getattr(motion, name)",
        "from tbdcore import motion\n\ng(motion)",
        "import tbdcore\n\nlaws = [tbdcore.motion]",
        "from tbdcore import motion\n\nmotion.not_there",
        "from tbdcore.motion import *",
    ],
)
def test_a_module_counts_as_a_whole_where_names_cannot_be_followed(package, code):
    before = reach.of_code(code)
    package("motion", MODULES["motion"].replace("SPARE = 3.0", "SPARE = 5.0"))
    assert reach.of_code(code) != before


def test_a_class_counts_with_all_its_methods(package):
    code = "from tbdcore.motion import Track\n\nTrack()"
    before = reach.of_code(code)
    package("motion", MODULES["motion"].replace("return 4", "return 5"))  # a method calls it
    assert reach.of_code(code) != before


@pytest.mark.parametrize(
    ("code", "counts"),
    [
        ("import tbdcore\n\ntbdcore.deep.below.far(1)", True),
        ("from tbdcore import deep\n\ndeep.below.far(1)", True),
        ("from tbdcore.deep.below import far\n\nfar(1)", True),
        ("from tbdcore.deep.below import near\n\nnear(1)", False),
    ],
)
def test_a_module_below_another_is_found(package, code, counts):
    before = reach.of_code(code)
    package("deep/below", MODULES["deep/below"].replace("x + 1", "x + 2"))
    assert (reach.of_code(code) != before) == counts


@pytest.mark.parametrize(("old", "new", "counts"), CHANGES.values(), ids=CHANGES)
def test_the_sources_of_a_pickled_trial(package, old, new, counts):
    """A function of a notebook is pickled with its code, which refers to modules by name."""
    motion = types.ModuleType("tbdcore.motion")
    motion.transition = lambda T: T
    space = {"motion": motion, "__name__": "__main__"}
    exec("def trial(seed, i):\n    return motion.transition(seed + i)", space)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "tbdcore.motion", motion)
        trial = cloudpickle.dumps(space["trial"])
    reach._kept.cache_clear()
    asked = reach.of_trial(trial)
    before = reach.at_worker(*asked)
    assert "tbdcore.motion" in before
    package("motion", textwrap.dedent(MODULES["motion"]).replace(old, new))
    assert reach.at_worker(*asked) == before  # as the process first read it
    reach._kept.cache_clear()
    assert (reach.at_worker(*asked) != before) == counts


def test_the_names_of_code_are_also_those_of_the_pages_that_it_uses():
    algorithm = "\n\n\n".join(pages.cells("track_cfar", "algorithm"))
    own, through = reach.names(algorithm), reach.names('tbdcore.page("track_cfar")')
    assert {module: names for module, names in own.items() if "kernels" in module}
    assert all(own[module] <= through[module] for module in own if module)
    assert "tbdcore.kernels.track_cfar" not in reach.names("import tbdcore")


def test_nothing_is_below_a_page(monkeypatch):
    """A pickle's words may join a page's module with a name in it."""
    monkeypatch.setattr(reach, "_first", reach._read)
    assert set(reach.at_worker("", [f"{reach.PAGE}track_cfar", "no_such_name"])) >= {
        f"{reach.PAGE}track_cfar"
    }


SAME = {
    "a comment": ("x = 1", "x = 1  # one"),
    "a docstring": (
        'def f():\n    """Old."""\n    return 1',
        'def f():\n    """New."""\n    return 1',
    ),
    "a module's docstring": ('"""Old."""\nx = 1', "x = 1"),
    "layout": ("f(1,\n  2)", "f(1, 2)"),
    "quotes": ("x = 'a'", 'x = "a"'),
    "parentheses": ("x = (1 + 2)", "x = 1 + 2"),
    "pieces of a string": ('x = f"a{b}c" f"d{e}"', 'x = f"a{b}cd{e}"'),
    "the text of an exception": ('raise E(a, "b", c=f"{d}")', 'raise E(a, f"{f:.2g}", c="g")'),
    "a text that is chosen or joined": (
        'raise E("a" if b else c + "d")',
        'raise E("" if b else c + "")',
    ),
}
OTHER = {
    "an entry of a dict": ('x = {"a": 1, "b": 2}', 'x = {"a": 1}'),
    "an element of a list": ("x = [a, b]", "x = [a]"),
    "a list for a tuple": ("def f(): return 1, 2", "def f(): return [1, 2]"),
    "a call": ("x = f(y)", "x = y"),
    "the order of arguments": ("f(a, b)", "f(b, a)"),
    "a slice": ("x = y[1:]", "x = y[:]"),
    "a statement": ("for x in y:\n    f()\n    g()", "for x in y:\n    f()"),
    "the order of statements": ("for x in y:\n    f()\n    g()", "for x in y:\n    g()\n    f()"),
    "the branches of a choice": ("x = a if b else c", "x = c if b else a"),
    "the module of an import": ("from a import b", "from c import b"),
    "a number": ("x = 1", "x = 2"),
    "a type": ("x = 1", "x = 1.0"),
    "a string that is no docstring": ('x = "a"', 'x = "b"'),
    "an operator": ("x < y", "x <= y"),
    "None": ("return_ = None", "return_ = 0"),
    "an empty list": ("x = []", "x = ()"),
    "a default": ("def f(a=None): return a", "def f(a): return a"),
    "a decorator": ("@g\ndef f(): return 1", "def f(): return 1"),
    "an imported name": ("from a import b", "from a import c"),
    "a keyword": ("f(a=1)", "f(b=1)"),
    "a comma between strings": ('x = ["a", "b"]', 'x = ["a" "b"]'),
    "an operator between numbers": ("x + y", "x - y"),
    "an operator of an assignment": ("x += y", "x -= y"),
    "a sign": ("-x", "+x"),
    "and": ("x and y", "x or y"),
    "a place for a space": ('x = f"{a} {b}"', 'x = f"{a}{b} "'),
    "a format": ('x = f"{a:.2f}"', 'x = f"{a:.3f}"'),
    "what an exception carries": ("raise E(a)", "raise E(b)"),
    "the exception": ('raise E("a")', 'raise F("a")'),
    "a call for an exception": ('raise E(f"{a()}")', 'raise E(f"{b()}")'),
    "an argument of a call for an exception": ('raise E(f("a"))', 'raise E(f("b"))'),
    "a text in a file": ('print("a", file=f)', 'print("b", file=f)'),
    "a text of a class in a function": tuple(
        f"def f():\n    class A:\n        a = '{text}'\n    return A" for text in "bc"
    ),
    "a printed line": ('print("a")', 'print("b")'),
    "a printed format": ('print(f"{x:.2f}")', 'print(f"{y:.2f}")'),
    "a warning": ('warnings.warn("a")', 'warnings.warn("b")'),
    "a text that an exception is given by name": (
        'def f():\n    a = "b"\n    raise E(a)',
        'def f():\n    a = "c"\n    raise E(a)',
    ),
}


@pytest.mark.parametrize("sources", SAME.values(), ids=SAME)
def test_what_does_not_change_the_meaning(sources):
    assert reach.meaning(sources[0]) == reach.meaning(sources[1])


@pytest.mark.parametrize("sources", OTHER.values(), ids=OTHER)
def test_what_changes_the_meaning(sources):
    assert reach.meaning(sources[0]) != reach.meaning(sources[1])


def test_the_meaning_is_the_same_on_every_python():
    """The digest of a source whose tree has other fields or pieces on other versions."""
    source = """
@g
class A(B, metaclass=C):
    def f(self, *a: int, k=None, **b) -> "str":
        return f'{self!r:>{9}}a{a:%H:%M}' f'{k=}' f'{{b}}' f'' f'{b:}' u'x'

async def h(x, /):
    async with x as y, y[1:, ...]:
        return [z async for z in y if not z] or {**x} or (yield -1.5e300, b'1', None)

match x:
    case {"a": [None, *_]} | C(b=1) if (x := 2):
        pass
"""
    assert reach.digest([reach.meaning(source).encode()]) == "2def9d065d482c50"


@pytest.mark.slow
def test_the_meaning_tells_apart_all_modules():
    sources = [file.read_text(encoding="utf-8") for file in paths.PACKAGE.rglob("*.py")]
    assert len({reach.meaning(source) for source in sources}) == len(sources)
    for source in sources:  # a tree that is written out and read again means the same
        assert reach.meaning(ast.unparse(ast.parse(source))) == reach.meaning(source)
