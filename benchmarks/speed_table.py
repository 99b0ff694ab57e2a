"""The tables of docs/results/speed.md, from what `mcloc bench --json` printed:

mcloc bench --json > speed.json
python benchmarks/speed_table.py speed.json
"""

import json
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

HEAD = "| particles | beams | threads | ms | ns / unit | NumPy, ms | ratio |"
UNITS = {
    **dict.fromkeys(("likelihood_field", "beam_cast", "beam_table"), "a particle and beam"),
    "distance_transform": "a cell",
}


def rows(results: list[dict[str, Any]]) -> list[str]:
    """Markdown, a table for each operation and cloud."""
    lines = []
    for (name, cloud), some in groupby(results, key=lambda r: (r["operation"], r["cloud"])):
        lines += [
            "",
            f"**{name}**{f', {cloud}' if cloud else ''} (per {UNITS.get(name, 'particle')})",
        ]
        lines += ["", HEAD, "|" + "---:|" * 7]
        for r in some:
            cells = [
                "" if r["particles"] is None else f"{r['particles']:,}",
                "" if r["beams"] is None else str(r["beams"]),
                str(r["threads"]),
                f"{r['ms']:.3g}",
                f"{r['ns_per_unit']:.3g}",
                "" if r["reference_ms"] is None else f"{r['reference_ms']:.3g}",
                "" if r["ratio"] is None else f"{r['ratio']:.1f}",
            ]
            lines.append(f"| {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    found = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    print(f"{found['cpu']}; {versions}.")
    print("\n".join(rows(found["results"])))
