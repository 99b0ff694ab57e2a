"""What the documents say exists, exists, and what they show runs."""

import ast
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mcloc.cli.main import app
from mcloc.report.history import COLUMNS
from mcloc.simulation import Scenario, museum_world, simulate, write_drive

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "mcloc"
CELL = re.compile(r"(?<!\\)\|")  # a bar of a table, not the \| of p(z \| x)
PYTHON_BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^\$ mcloc (.*)$", re.MULTILINE)
LINK = re.compile(r"\[[^\]]*\]\(([^)#]+)(?:#[^)]*)?\)")


def equations() -> list[dict[str, str]]:
    """Rows of the tables `equation | meaning | file | function` in docs/equations.md."""
    rows, columns = [], None
    for line in (ROOT / "docs/equations.md").read_text(encoding="utf-8").splitlines():
        if not line.startswith("|"):
            columns = None
            continue
        cells = [cell.strip() for cell in CELL.split(line)[1:-1]]
        if columns is None:
            columns = cells
        elif set(line) - set("|-: "):
            rows.append(dict(zip(columns, cells, strict=True)))
    return rows


def definitions(file: Path) -> set[str]:
    """Names of all functions, classes and constants of a file; `Class.method` for methods."""

    def names(body: list[ast.stmt], prefix: str) -> set[str]:
        found = set()
        for node in body:
            if isinstance(node, ast.FunctionDef):
                found.add(prefix + node.name)
            elif isinstance(node, ast.ClassDef):
                found |= {prefix + node.name} | names(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.Assign):
                found |= {prefix + t.id for t in node.targets if isinstance(t, ast.Name)}
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(prefix + node.target.id)
        return found

    return names(ast.parse(file.read_text(encoding="utf-8")).body, "")


def test_every_equation_is_where_the_table_says() -> None:
    rows = equations()
    assert rows, "docs/equations.md holds no table of equations"
    for row in rows:
        (file,) = re.findall(r"`([^`]+)`", row["file"])
        functions = re.findall(r"`([^`]+)`", row["function"])
        assert functions, f"{row['equation']}: names no function"
        assert (PACKAGE / file).is_file(), f"{row['equation']}: there is no src/mcloc/{file}"
        missing = set(functions) - definitions(PACKAGE / file)
        assert not missing, f"{row['equation']}: {file} does not define {missing}"


@pytest.fixture
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder demo/ of `make demo`, after a shorter drive; its parent is where things run."""
    drive = simulate(museum_world(4), 4, Scenario(length=10.0))
    write_drive(drive, tmp_path / "demo", "mcap")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "demo"


def test_the_python_in_the_readme_runs(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = PYTHON_BLOCK.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert blocks, "README.md shows no Python"
    monkeypatch.chdir(demo)
    names: dict[str, object] = {"__name__": "__main__"}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)


@pytest.mark.slow
@pytest.mark.usefixtures("demo")
@pytest.mark.parametrize("document", ["README.md", "docs/guide.md"])
def test_the_commands_shown_run(document: str) -> None:
    commands = COMMAND.findall((ROOT / document).read_text(encoding="utf-8"))
    assert commands, f"{document} shows no commands"
    for command in commands:
        result = CliRunner().invoke(app, shlex.split(command))
        assert result.exit_code == 0, f"mcloc {command}: {result.output}"


def test_the_guide_names_every_column_of_the_estimates() -> None:
    text = (ROOT / "docs/guide.md").read_text(encoding="utf-8")
    table = text.split("Columns of `estimates.csv`:\n", maxsplit=1)[1].split("\n\n", maxsplit=1)[0]
    named = [name for row in table.splitlines() for name in re.findall(r"`(\w+)`", row)]
    assert named == list(COLUMNS)


def block_of_architecture(heading: str) -> list[str]:
    """Lines of the first ``` block under a heading of docs/architecture.md."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    section = text.split(f"## {heading}\n", maxsplit=1)[1]
    return section.split("```\n", maxsplit=2)[1].splitlines()


def test_the_architecture_names_the_rooms_that_exist() -> None:
    named = {line.split()[0] for line in block_of_architecture("Rooms")}
    rooms = {f"{path.name}/" for path in PACKAGE.iterdir() if any(path.glob("*.py"))}
    assert named == rooms | {path.name for path in PACKAGE.glob("*.py")}


def test_the_architecture_shows_the_layers_that_are_held() -> None:
    shown = [set(line.split()) for line in block_of_architecture("Layers")]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]["contracts"]
    held = [set(row.split(" : ")) for row in contracts[0]["layers"] if not row.startswith("(")]
    assert shown == held


DOCUMENTS = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    links = LINK.findall(path.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert not [link for link in local if not (path.parent / link).exists()]
