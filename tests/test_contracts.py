"""The contracts of the house: who may import whom, and what a wheel must carry."""

import ast
import functools
import re
import subprocess
import tomllib
import zipfile
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from bench.cold_start import build_wheel
from smad.cli import docs as pages
from smad.errors import SmadError

ROOT = Path(__file__).resolve().parent.parent
FLOORS = {"firmware_protocol": 0, "sim_device": 1, "smad": 2, "firmware": 2}

# Folder -> what its modules must not import, beyond the order of the floors.
FORBIDDEN = {
    "firmware_protocol": {"numpy", "scipy", "serial", "zmq", "socket", "asyncio", "time", "click"},
    "smad/control": {
        "serial",
        "zmq",
        "socket",
        "asyncio",
        "pathlib",
        "time",
        "smad.daemon",
        "smad.runlog",
    },
    "smad/diagnosis": {
        "serial",
        "zmq",
        "socket",
        "asyncio",
        "smad.daemon",
        "smad.client",
        "smad.checkup",
    },
    "smad/daemon": {"sim_device"},
    "firmware": {"smad"},
    "smad": {"firmware", "campaign", "evaluation", "bench", "tests"},
    "evaluation/plant": {"smad", "sim_device", "firmware_protocol"},
}
SKIP = "# fmt: skip"
LONGEST_FUNCTION = 60
MOST_ARGUMENTS = 7
"""`self` and six others."""

# The folders of the diagnosis, each with those that it must not know.
FOLDERS_ABOVE = {
    "numerics": ("data", "places", "rivals", "report", "spring_pair"),
    "data": ("places", "rivals", "report", "spring_pair"),
    "places": ("rivals", "report", "spring_pair"),
    "rivals": ("report", "spring_pair"),
    "report": ("constants", "questions", "diagnose", "spring_pair"),
}
# Who shows the report: what it says decides nothing.
SHOW_REPORTS = ("smad.cli.", "smad.diagnosis.report.")
# Tools of a package that are run by hand; they may read a clock or a file.
EXEMPT_NAMES = {"generate.py", "__main__.py"}


def imports_of(path: Path) -> set[str]:
    found: set[str] = set()
    package = list(path.relative_to(ROOT).with_suffix("").parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found.add(module)
            found.update(f"{module}.{alias.name}" for alias in node.names)
    return found


def modules_under(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("package", FLOORS)
def test_imports_between_packages_go_down_only(package: str) -> None:
    upward = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules_under(package)
        for name in imports_of(path)
        if FLOORS.get(name.split(".")[0], -1) > FLOORS[package]
    ]
    assert not upward


@functools.cache
def graph_of_imports() -> dict[str, set[str]]:
    """Every module of the packages and which others it imports, for types only included."""
    files = {name_of(path): path for package in FLOORS for path in modules_under(package)}
    return {module: imported_modules(path, files) - {module} for module, path in files.items()}


def imported_modules(path: Path, files: Mapping[str, Path]) -> set[str]:
    """Which of `files` a module imports; `from a import b` is the module `a.b` if there is one."""
    wanted: set[tuple[str, ...]] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            wanted |= {(alias.name,) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None, f"{path}: a relative import"
            wanted |= {(f"{node.module}.{alias.name}", node.module) for alias in node.names}
    found = set()
    for names in wanted:
        candidates = [c for name in names for c in (name, f"{name}.__init__") if c in files]
        found.update(candidates[:1])
    return found


def name_of(path: Path) -> str:
    """`a.b.c`; a package's own module is `a.b.__init__`."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def cycle_in(graph: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def children_of(folder: str, graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The modules and folders right under a folder, and which of each other they import."""
    depth = folder.count(".") + 2

    def child(module: str) -> str:
        return ".".join(module.split(".")[:depth])

    inside = {module for module in graph if module.startswith(folder + ".")}
    found: dict[str, set[str]] = {}
    for module in inside:
        others = {child(name) for name in graph[module] & inside}
        found.setdefault(child(module), set()).update(others - {child(module)})
    return found


def test_no_module_imports_itself_by_way_of_others() -> None:
    assert cycle_in(graph_of_imports()) == []


def test_no_room_imports_itself_by_way_of_others() -> None:
    graph = graph_of_imports()
    folders = {module.rpartition(".")[0] for module in graph}
    assert {"smad", "smad.daemon", "smad.diagnosis.data"} <= folders
    cycles = {folder: cycle_in(children_of(folder, graph)) for folder in folders}
    assert {folder: cycle for folder, cycle in cycles.items() if cycle} == {}


@pytest.mark.parametrize("folder", FOLDERS_ABOVE)
def test_a_folder_of_the_diagnosis_imports_only_folders_below_it(folder: str) -> None:
    graph = graph_of_imports()
    modules = [name for name in graph if name.startswith(f"smad.diagnosis.{folder}.")]
    assert modules
    above = tuple(f"smad.diagnosis.{name}" for name in FOLDERS_ABOVE[folder])
    assert [
        f"{module} imports {name}"
        for module in modules
        for name in graph[module]
        if name.startswith(above)
    ] == []


def test_the_report_of_a_diagnosis_is_imported_by_nobody_who_decides() -> None:
    assert [
        f"{module} imports {name}"
        for module, others in graph_of_imports().items()
        for name in others
        if name.startswith("smad.diagnosis.report.") and not module.startswith(SHOW_REPORTS)
    ] == []


def test_no_room_imports_the_command_line() -> None:
    assert [
        f"{module} imports {name}"
        for module, others in graph_of_imports().items()
        for name in others
        if name.startswith("smad.cli.")
        and not module.startswith("smad.cli.")
        and module != "smad.__main__"
    ] == []


def test_a_check_up_knows_neither_screen_nor_arguments() -> None:
    folders = ("smad.checkup.", "smad.experiments.", "smad.diagnosis.")
    assert [
        f"{path.relative_to(ROOT)} imports click"
        for folder in folders
        for path in modules_under(folder.strip(".").replace(".", "/"))
        if "click" in imports_of(path)
    ] == []


def test_the_first_design_of_the_diagnosis_is_gone() -> None:
    needle = re.compile(r"smad[./]g" + r"ap\b(?! )")
    sources = [p for folder in ("smad", "tests", "examples") for p in modules_under(folder)]
    assert not (ROOT / "smad" / "gap").exists()
    assert [str(p.relative_to(ROOT)) for p in sources if needle.search(p.read_text())] == []


def test_a_circle_is_found_between_modules_and_between_rooms() -> None:
    modules = {"a.x.one": {"a.x.two"}, "a.x.two": {"a.x.one"}}
    assert set(cycle_in(modules)) == {"a.x.one", "a.x.two"}
    folders = {"a.x.one": {"a.y.one"}, "a.y.two": {"a.x.two"}, "a.y.one": set(), "a.x.two": set()}
    assert cycle_in(folders) == []
    assert set(cycle_in(children_of("a", folders))) == {"a.x", "a.y"}


@pytest.mark.parametrize("folder", FORBIDDEN)
def test_a_pure_room_imports_nothing_it_must_not_know(folder: str) -> None:
    modules = modules_under(folder)
    assert modules, f"{folder} holds no modules: the contract names a folder that is gone"
    broken = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules
        if path.name not in EXEMPT_NAMES and "generate" not in path.parts
        for name in imports_of(path)
        if any(name == bad or name.startswith(bad + ".") for bad in FORBIDDEN[folder])
    ]
    assert not broken


def test_no_function_of_the_daemon_is_long_and_no_constructor_takes_many_things() -> None:
    functions = [
        (path, node)
        for path in modules_under("smad/daemon")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    assert len(functions) > 300
    long = [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path, node in functions
        if (node.end_lineno or 0) - node.lineno >= LONGEST_FUNCTION
        or len(node.args.args) + len(node.args.kwonlyargs) > MOST_ARGUMENTS
    ]
    assert long == []


CELLS = (
    ast.Constant, ast.JoinedStr, ast.FormattedValue, ast.Name, ast.Attribute, ast.Subscript,
    ast.UnaryOp, ast.unaryop, ast.BinOp, ast.operator, ast.Call, ast.Starred, ast.expr_context,
    ast.Tuple, ast.List, ast.Set, ast.Dict,
)  # fmt: skip
"""What stands in a table: constants, names, sums of them, and records of them by position."""


def in_rows(node: ast.AST | None) -> bool:
    """Whether it is a literal of several lines."""
    literal = isinstance(node, ast.Tuple | ast.List | ast.Set | ast.Dict)
    return literal and (node.end_lineno or 0) > node.lineno


def skips_without_table(text: str) -> list[int]:
    """The lines whose `fmt: skip` ends no table.

    A table is a literal in rows of `CELLS`, or a constant of the module in rows of anything. An
    argument by keyword is no table.
    """
    tree, lines = ast.parse(text), text.splitlines()
    inside = {id(n) for k in ast.walk(tree) if isinstance(k, ast.keyword) for n in ast.walk(k)}
    tables: list[ast.AST] = [
        node
        for node in ast.walk(tree)
        if in_rows(node)
        and id(node) not in inside
        and all(isinstance(cell, CELLS) for cell in ast.walk(node))
    ]
    constants = [s.value for s in tree.body if isinstance(s, ast.Assign | ast.AnnAssign)]
    tables += filter(in_rows, constants)

    def ends_table(number: int) -> bool:
        for table in tables:
            end, column = table.end_lineno or 0, table.end_col_offset or 0
            last = lines[end - 1].encode()[column:].decode()
            after = "".join([last, *lines[end:number]]).removesuffix(SKIP)
            if end <= number and not after.strip(" )]},:"):
                return True
        return False

    return [n for n, line in enumerate(lines, 1) if line.endswith(SKIP) and not ends_table(n)]


def test_the_formatter_is_skipped_for_tables_only() -> None:
    tracked = subprocess.run(
        ["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    texts = {name: (ROOT / name).read_text() for name in tracked if (ROOT / name).is_file()}
    skipping = {name: text for name, text in texts.items() if SKIP in text}
    assert len(skipping) > 20
    assert [f"{n}:{k}" for n, text in skipping.items() for k in skips_without_table(text)] == []


def test_a_call_with_keywords_is_no_table() -> None:
    assert skips_without_table(f"ROWS = [\n    F(1), F(x=2),\n]  {SKIP}\n") == []
    assert skips_without_table(f"f = G([\n    F(1), F(2),\n])  {SKIP}\n") == []
    assert skips_without_table(f"f = G([\n    F(1), F(x=2),\n])  {SKIP}\n") == [3]
    assert skips_without_table(f"f = G(x=[\n    1, 2,\n])  {SKIP}\n") == [3]


def test_no_committed_file_names_a_path_of_a_developers_machine() -> None:
    tracked = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.splitlines()
    needle = "/wo" + "rk/"
    assert [
        name
        for name in tracked
        if (ROOT / name).is_file() and needle in (ROOT / name).read_text(errors="ignore")
    ] == []


def test_every_data_file_of_the_packages_is_in_the_wheel(tmp_path: Path) -> None:
    wheel = build_wheel(tmp_path)
    inside = set(zipfile.ZipFile(wheel).namelist())
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = {
        str(path.relative_to(ROOT))
        for package in packages["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert wanted <= inside
    assert not [
        name for name in inside if name.startswith(("evaluation/", "campaign/", "tests/", "bench/"))
    ]
    with zipfile.ZipFile(wheel) as packed:
        (about,) = (name for name in inside if name.endswith(".dist-info/METADATA"))
        metadata = packed.read(about).decode()
    for line in ("Author: the smad authors", "Keywords: ", "Classifier: Typing :: Typed"):
        assert f"\n{line}" in metadata
    for package in packages["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]:
        assert f"{package}/py.typed" in inside
    shipped = {n.removeprefix("smad/data/docs/") for n in inside if n.startswith("smad/data/docs/")}
    assert {f"{page}.md" for page in cited_pages()} <= shipped


def cited_pages() -> set[str]:
    """Pages that messages refer to, as `smad docs PAGE`."""
    sources = [p for folder in ("smad", "firmware_protocol") for p in (ROOT / folder).rglob("*.py")]
    found = {n for p in sources for n in re.findall(r"smad docs ([a-z][a-z0-9/-]+)", p.read_text())}
    return {name for name in found if not name.endswith("/")}


def test_every_page_that_a_message_refers_to_is_printed_by_its_command() -> None:
    cited = cited_pages()
    assert len(cited) > 5
    for name in cited:
        assert pages.text(name).startswith("# ")
    with pytest.raises(SmadError, match=r"no such page; got guide/client; allowed: guide/clients"):
        pages.text("guide/client")


def test_the_authors_and_keywords_of_the_package_are_those_of_the_citation() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = (ROOT / "CITATION.cff").read_text()
    for word in [*project["keywords"], *(author["name"] for author in project["authors"])]:
        assert word in citation


def test_every_room_that_the_architecture_page_names_is_there() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (`[^|]*) \|", page, flags=re.MULTILINE)
    named = [name for row in rows for name in re.findall(r"`([\w./*-]+)`", row) if "/" in name]
    assert len(named) > 15
    assert [name for name in named if not any(ROOT.glob(name.rstrip("/")))] == []


def packages_of_debian(text: str, begin: str, end: str) -> set[str]:
    part = text.partition(begin)[2].partition(end)[0]
    return set(part.replace("\\", " ").split())


def test_the_container_and_ci_install_the_same_packages_of_the_same_debian() -> None:
    dockerfile = (ROOT / "Dockerfile").read_text()
    contained = packages_of_debian(dockerfile, "--no-install-recommends", "&&")
    assert contained == packages_of_debian((ROOT / ".ci/run").read_text(), 'packages="', '"')
    assert "FROM debian:bookworm" in dockerfile
    workflow = (ROOT / ".github/workflows/ci.yml").read_text()
    assert "container: debian:bookworm\n" in workflow
    assert re.findall(r"run: (.+)", workflow) == [".ci/run"]
