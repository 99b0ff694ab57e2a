"""The table of studies in docs/results/README.md, from the verdicts of their full runs.

    mcloc study run E5 --out /tmp/studies
    python benchmarks/results_table.py /tmp/studies

copies what the given folder holds of each study into docs/results/, and renews the table; without a
folder it renews the table alone.
"""

import argparse
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

from mcloc.experiments.catalog import STUDIES

RESULTS = Path(__file__).parents[1] / "docs" / "results"
KEPT = ("table.csv", "verdict.json", "figure.png", "study.md")
START, END = "<!-- studies -->\n", "<!-- /studies -->\n"
HEAD = ("study", "about", "claim", "the paper's figure", "ours (95 %)", "verdict", "command")


def rows(results: Path) -> Iterator[str]:
    """A line for each study that was run in full, its claims below each other."""
    yield f"| {' | '.join(HEAD)} |"
    yield "|" + "---|" * len(HEAD)
    for number, study in STUDIES.items():
        file = results / study.folder / "verdict.json"
        if not file.exists():
            continue
        claims = json.loads(file.read_text(encoding="utf-8"))["claims"]
        cells = [
            number,
            f"[{study.title}]({study.folder}/study.md)",
            *(
                "<br>".join(f"({k}) {cell(claim)}" for k, claim in enumerate(claims, 1))
                for cell in (
                    lambda claim: claim["claim"],
                    lambda claim: claim["paper"],
                    lambda claim: f"{claim['figure']}: {claim['told']}",
                    lambda claim: claim["verdict"],
                )
            ),
            f"`mcloc study run {number}`",
        ]
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def renewed(page: str, results: Path) -> str:
    """The page with its table anew."""
    before, rest = page.split(START)
    _, after = rest.split(END)
    return before + START + "\n".join(rows(results)) + "\n" + END + after


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="where studies were run in full")
    arguments = parser.parse_args()
    for study in STUDIES.values():
        made = None if arguments.folder is None else arguments.folder / study.folder
        if made is not None and (made / "verdict.json").exists():
            (RESULTS / study.folder).mkdir(exist_ok=True)
            for name in KEPT:
                shutil.copyfile(made / name, RESULTS / study.folder / name)
    page = RESULTS / "README.md"
    page.write_text(renewed(page.read_text(encoding="utf-8"), RESULTS), encoding="utf-8")


if __name__ == "__main__":
    main()
