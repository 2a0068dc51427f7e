"""The same sources: which definitions code reaches by name, and a digest of what they mean.

The code is that of a notebook's cells, or of a trial that goes to another machine.  Its names are
followed through the modules of this package: imports, attributes of modules, what a definition
reads.  What a module does when it is loaded always counts, and so does a class as a whole.  Where a
name cannot be followed (a module is handed on, ``globals()``, ``from x import *``), its whole
module counts.  Docstrings, comments and the texts of exceptions do not.
"""

import ast
import dataclasses
import functools
import pickletools
import re
import symtable
import sys
from pathlib import Path

from tbdcore.repro import paths
from tbdcore.repro.products import digest

PACKAGE = "tbdcore"
PAGE = "tbdcore_page_"  # begins the name of a notebook's algorithm cells as a module
DYNAMIC = {"globals", "import_module", "__import__"}
# calls that change nothing beyond the name that a statement binds; a class (a capital) as well
PLAIN = {
    "abs",
    "cache",
    "cached_property",
    "checked",
    "classmethod",
    "compile",
    "contextmanager",
    "dataclass",
    "dict",
}
PLAIN |= {"dtype", "field", "finfo", "float", "fromkeys", "frozenset", "hasattr", "int", "items"}
PLAIN |= {"join", "kernel", "len", "list", "log", "lru_cache", "maketrans", "max", "min"}
PLAIN |= {
    "namedtuple",
    "partial",
    "property",
    "quote",
    "range",
    "resolve",
    "set",
    "setter",
    "sorted",
}
PLAIN |= {"split", "sqrt", "staticmethod", "str", "sum", "tuple", "ulp", "wraps", "zip"}
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef
CALLS = ast.Call | ast.NamedExpr | ast.Await | ast.Yield | ast.YieldFrom
JOINED = {ast.IfExp: ("body", "orelse"), ast.BinOp: ("left", "right")}


@dataclasses.dataclass(frozen=True)
class Statement:
    """A statement of a module, outside its functions and classes."""

    binds: frozenset  # the names that it gives to its module
    imports: tuple  # (local name, module, name in the module or "") of the imports inside it
    chains: frozenset  # what it reads of its module and imports: ("kalman", "update")
    acts: bool  # it may change other things than its names when the module is loaded
    dynamic: bool  # it may read any name of its module
    is_import: bool
    text: str  # digest of its meaning


def of_code(code, pages=()):
    """Digests of what some code and some pages reach, by module; `pages` are names of notebooks
    whose algorithm cells count as a whole.  SyntaxError when the code is no Python.
    """
    walk = _Walk(_read, {"": code})
    walk.whole("")
    for paper in {*pages, *_pages_in(code)}:
        walk.whole(PAGE + paper)
    return walk.digests()


def names(code):
    """The names of each module that some code reaches, as a set by module."""
    walk = _Walk(_read, {"": code})
    walk.whole("")
    for paper in _pages_in(code):
        walk.whole(PAGE + paper)
    return {
        module: set().union(*(walk.modules[module][i].binds for i in reached))
        for module, reached in walk.reached.items()
    }


def of_trial(pickle):
    """Code and words that :func:`at_worker` needs to find the sources of a pickled trial.

    Functions of a notebook are pickled with their code, whose names are among the pickle's words;
    a function of another module is a reference, and the source of that module counts.
    """
    words = {word for _, word, _ in pickletools.genops(pickle) if isinstance(word, str)}
    code, library = [], (sys.base_prefix, sys.prefix)
    for word in sorted(words):
        file = getattr(sys.modules.get(word), "__file__", None) or ""
        own = word.split(".")[0] == PACKAGE or word.startswith(PAGE) or word == "__main__"
        if file.endswith(".py") and not own and not file.startswith(library):
            code.append(Path(file).read_text(encoding="utf-8"))
    return "\n".join(code), sorted(word for word in words if word.replace(".", "").isidentifier())


def at_worker(code, words):
    """Digests of the sources that a trial reaches, by module, as this process first read them."""
    walk = _Walk(functools.cache(_first), {"": code})
    walk.whole("")
    for word in words:
        if walk.exists(word):
            walk.named(word, words)
    used = _pages_in(code) | (_pages_in(" ".join(map(repr, words))) if "page" in words else set())
    for paper in used:
        walk.whole(PAGE + paper)
    return walk.digests()


def _pages_in(code):
    """The notebooks that code may use as modules: those it names, if it calls ``page``."""
    from tbdcore.repro import pages

    named = set(re.findall(r"[\"'](\w+)[\"']", code) if re.search(r"\bpage\b", code) else ())
    return named.intersection(pages.notebooks()) if named else set()


def _read(module):
    """The source of a module of this package or of a page, None when there is none."""
    if module.startswith(PAGE):
        from tbdcore.repro import pages

        paper = module.removeprefix(PAGE)  # nothing is below a page
        return "\n\n\n".join(pages.cells(paper, "algorithm")) if paper.isidentifier() else None
    top, *names = module.split(".")
    folder = paths.PACKAGE.joinpath(*names)
    for file in (folder.with_suffix(".py"), folder / "__init__.py") if top == PACKAGE else ():
        if file.is_file() and (names or file.parent == folder):
            return file.read_text(encoding="utf-8")
    return None


def _first(module):
    """A module's source as this process first read it; a page's as it is now."""
    return _read(module) if module.startswith(PAGE) else _kept(module, paths.PACKAGE)


@functools.cache
def _kept(module, package):
    return _read(module)


class _Walk:
    """A walk along names; what it has reached are statements by module."""

    def __init__(self, read, sources):
        self.read, self.modules = read, {}
        self.reached, self.done = {}, set()
        for name, source in sources.items():
            self.modules[name] = statements(source, name)

    def digests(self):
        """A digest for each module, of the reached statements in the order of its source."""
        return {
            module or "code": digest(self.modules[module][i].text.encode() for i in sorted(reached))
            for module, reached in self.reached.items()
            if reached
        }

    def exists(self, module):
        """Whether a module is one of those that are followed."""
        if module not in self.modules:
            ours = module.split(".")[0] == PACKAGE and module != __name__
            source = self.read(module) if ours or module.startswith(PAGE) else None
            self.modules[module] = None if source is None else statements(source, module)
        return self.modules[module] is not None

    def load(self, module):
        """What a module does when it is loaded, with the packages that it is in."""
        if not self._new("load", module):
            return
        self.load(module.rpartition(".")[0])
        if not self.exists(module):
            return
        for i, statement in enumerate(self.modules[module]):
            for _, target, name in statement.imports if statement.is_import else ():
                self.load(f"{target}.{name}".rstrip("."))
            if statement.acts:
                self.add(module, i)

    def whole(self, module):
        """Every statement of a module."""
        if self._new("whole", module) and self.exists(module):
            self.load(module)
            for i in range(len(self.modules[module])):
                self.add(module, i)

    def named(self, module, words):
        """What some words name in a module and in the modules below it."""
        if not self._new("named", module):
            return
        self.load(module)
        bound = set().union(*(each.binds for each in self.modules[module]))
        for word in words:
            if word in bound:
                self.follow(module, (word,))
            elif self.exists(f"{module}.{word}"):
                self.named(f"{module}.{word}", words)

    def add(self, module, i):
        """One statement, and all that it reads."""
        if not self._new(module, i):
            return
        self.reached.setdefault(module, set()).add(i)
        statement = self.modules[module][i]
        for _, target, name in statement.imports:
            self.load(f"{target}.{name}".rstrip("."))
            if name == "*":
                self.whole(target)
        for chain in statement.chains if not statement.is_import else ():
            self.follow(module, chain, inside=statement)
        if statement.dynamic:
            self.whole(module)

    def follow(self, module, chain, inside=None):
        """What a chain of names means in a module: ``("kalman", "update")``."""
        if not self.exists(module) or not self._new("follow", module, chain, inside):
            return
        self.load(module)
        if not chain:
            self.whole(module)
            return
        name, *rest = chain
        bound = False
        for i, statement in enumerate(self.modules[module]):
            if name in statement.binds:
                bound = True
                self.add(module, i)
                self._imported(statement, name, rest)
        if inside and any(local == name for local, *_ in inside.imports):
            bound = True
            self._imported(inside, name, rest)
        if not (bound or inside or self._below(module, name, rest) or name.startswith("__")):
            hook = any("__getattr__" in each.binds for each in self.modules[module])
            self.follow(module, ("__getattr__",)) if hook else self.whole(module)

    def _imported(self, statement, name, rest):
        """Follow a name that a statement imports to where it comes from."""
        for local, target, original in statement.imports:
            if local == name and not original:
                self.follow(target, tuple(rest))
            elif local == name and original != "*":
                self._below(target, original, rest)
                self.follow(target, (original, *rest))

    def _below(self, module, name, rest):
        """Follow a name to the module below that it names, if there is one."""
        below = f"{module}.{name}"
        is_module = module.split(".")[0] == PACKAGE and self.exists(below)
        if is_module:
            self.follow(below, tuple(rest))
        return is_module or below == __name__

    def _new(self, *step):
        """Whether a step has not been made before."""
        before = len(self.done)
        self.done.add(step)
        return len(self.done) > before


@functools.lru_cache(maxsize=256)
def statements(source, module=""):
    """The statements of a source as a tuple of :class:`Statement`; imports become one for each
    name.  A docstring is none.
    """
    tree = ast.parse(source)
    body = tree.body[ast.get_docstring(tree, clean=False) is not None :]
    return tuple(_statement(node, module, source) for part in body for node in _divided(part))


def _divided(node):
    """An import of several names as several imports, any other statement as it is."""
    if not isinstance(node, ast.Import | ast.ImportFrom):
        return [node]
    fields = dict(ast.iter_fields(node))
    return [type(node)(**fields | {"names": [name]}) for name in node.names]


def _statement(node, module, source):
    """One statement of a module, read."""
    table = symtable.symtable(ast.unparse(node), module, "exec")
    imports = tuple(
        target
        for each in ast.walk(node)
        if isinstance(each, ast.Import | ast.ImportFrom)
        for target in _targets(each, module, source)
    )
    names = _read_names(table) | {local for local, *_ in imports}
    tops = table.get_symbols()
    binds = {it.get_name() for it in tops if it.is_assigned() or it.is_imported()}
    return Statement(
        binds=frozenset(binds | _global_names(node)),
        imports=imports,
        chains=frozenset(chain for chain in _chains(node) if chain[0] in names),
        acts=_acts(node),
        dynamic=_dynamic(node),
        is_import=isinstance(node, ast.Import | ast.ImportFrom),
        text=digest([meaning(ast.unparse(node)).encode()]),
    )


def _targets(node, module, source):
    """(local name, module, name in it or "") for each name of an import."""
    if isinstance(node, ast.Import):
        for each in node.names:
            if each.asname:
                yield each.asname, each.name, ""
            else:
                yield each.name.split(".")[0], each.name.split(".")[0], ""
                yield "", each.name, ""  # is loaded as well
        return
    base = node.module or ""
    if node.level:
        is_package = (paths.PACKAGE.joinpath(*module.split(".")[1:]) / "__init__.py").is_file()
        parts = module.split(".")
        parts = parts[: len(parts) - node.level + is_package]
        base = ".".join([*parts, *([base] if base else [])])
    for each in node.names:
        yield each.asname or each.name, base, each.name


def _read_names(table):
    """Names that a symbol table and those inside it read from the module."""
    outer = table.get_type() != "function"
    names = {
        symbol.get_name()
        for symbol in table.get_symbols()
        if symbol.is_global() or (outer and symbol.is_referenced())
    }
    return names.union(*map(_read_names, table.get_children()))


def _global_names(node):
    """Names that functions of a statement give to the module."""
    return {name for each in ast.walk(node) if isinstance(each, ast.Global) for name in each.names}


def _chains(node):
    """Names that are read with the attributes that follow them: ``("kalman", "update")``."""
    todo = [node]
    while todo:
        each = todo.pop()
        chain, base = [], each
        while isinstance(base, ast.Attribute):
            chain.insert(0, base.attr)
            base = base.value
        if isinstance(base, ast.Name):
            yield (base.id, *chain)
        else:
            todo += ast.iter_child_nodes(each)


def _dynamic(node):
    """Whether a statement may read any name of its module."""
    calls = [each for each in ast.walk(node) if isinstance(each, ast.Call)]
    named = [(getattr(it.func, "id", getattr(it.func, "attr", "")), len(it.args)) for it in calls]
    own = {("eval", 1), ("exec", 1), ("vars", 0)}  # in the module's names, not in others
    return any(name in DYNAMIC or (name, n) in own for name, n in named)


def _acts(node):
    """Whether a statement may change other things than its names when its module is loaded."""
    if isinstance(node, FUNCTIONS | ast.ClassDef):
        inside = [*node.body] if isinstance(node, ast.ClassDef) else node.args.defaults
        return any(map(_calls, node.decorator_list)) or any(
            _acts(each) if isinstance(each, ast.stmt) else _calls_inside(each) for each in inside
        )
    if isinstance(node, ast.Import | ast.ImportFrom | ast.Pass):
        return any(alias.name == "*" for alias in getattr(node, "names", ()))
    if isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        named = all(isinstance(it, ast.Name | ast.Tuple | ast.List) for it in targets)
        inner = [it for target in targets for it in getattr(target, "elts", ())]
        named = named and all(isinstance(it, ast.Name) for it in inner)
        return not named or _calls_inside(node)
    return not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))


def _calls(decorator):
    """Whether a decorator, with or without arguments, may do more than change its function."""
    call = decorator.func if isinstance(decorator, ast.Call) else decorator
    name = getattr(call, "attr", getattr(call, "id", ""))
    return name not in PLAIN and not name.strip("_")[:1].isupper()


def _calls_inside(node):
    """Whether an expression calls what is not :data:`PLAIN` when it is evaluated."""
    if isinstance(node, ast.Lambda):
        return any(map(_calls_inside, node.args.defaults))
    if isinstance(node, ast.Call) and _calls(node):
        return True
    return any(map(_calls_inside, ast.iter_child_nodes(node)))


@functools.lru_cache(maxsize=4096)
def meaning(source):
    """What a source computes: its syntax tree as text, the same on every Python.

    Comments, docstrings and layout do not count, nor do strings and f-strings among the arguments
    of an exception that is raised; the calls in such an f-string count.
    """
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args = [_silent(argument) for argument in node.exc.args]
            for keyword in node.exc.keywords:
                keyword.value = _silent(keyword.value)
    for node in ast.walk(tree):
        _strip(node)
    return ast.dump(tree)


def _silent(node):
    """An expression without its texts but for the calls in them."""
    for part in JOINED.get(type(node), ()):
        setattr(node, part, _silent(getattr(node, part)))
    text = isinstance(node, ast.JoinedStr) or isinstance(getattr(node, "value", None), str)
    return ast.JoinedStr([it for it in ast.walk(node) if isinstance(it, CALLS)]) if text else node


def _strip(node):
    """Take the docstring from a node, and the fields that only some versions of Python have."""
    if isinstance(node, ast.Module | ast.ClassDef | FUNCTIONS):
        node.body = node.body[ast.get_docstring(node, clean=False) is not None :]
    if isinstance(node, ast.JoinedStr):  # Python versions divide its texts differently
        merged = []
        for piece in node.values:
            if merged and isinstance(piece, ast.Constant) and isinstance(merged[-1], ast.Constant):
                piece = ast.Constant(merged.pop().value + piece.value)
            merged.append(piece)
        node.values = [piece for piece in merged if getattr(piece, "value", None) != ""]
    for name, value in [*vars(node).items()]:
        empty = value in (None, []) and not isinstance(node, ast.Constant)
        if empty or name in ("kind", "type_comment"):
            delattr(node, name)
