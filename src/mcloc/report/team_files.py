"""The folder of results of a team."""

import re
from pathlib import Path

from mcloc.io.tum import write_tum
from mcloc.report.summary import to_json
from mcloc.report.team_picture import draw_team
from mcloc.report.team_run import TeamRun
from mcloc.storage import replacing

OWN = re.compile(r"robot\d+\.(csv|tum)|team\.png")
"""What a run of a team may write besides its summary."""


def write_team(run: TeamRun, folder: Path, plot: bool = True) -> None:
    """Write summary.json, for each robot N that ever had a place robotN.csv and robotN.tum, and
    team.png, of which each is replaced as a whole. Those of an earlier run that this one does not
    write are removed. Raises McLocError where that cannot be.
    """
    with replacing(folder / "summary.json") as path:
        path.write_text(to_json(run.summary()), encoding="utf-8")
    placed = {name: of.history for name, of in run.members.items() if len(of.history)}
    for name, history in placed.items():
        with replacing(folder / f"robot{name}.csv") as path:
            lines = (f"{line}\n" for line in history.estimates_csv())
            path.write_text("".join(lines), encoding="utf-8")
        with replacing(folder / f"robot{name}.tum") as path:
            write_tum(history.trajectory, path)
    if plot and placed:
        with replacing(folder / "team.png") as path:
            draw_team(run, path)
    written = {f"robot{name}{kind}" for name in placed for kind in (".csv", ".tum")}
    written |= {"team.png"} if plot and placed else set()
    for file in folder.iterdir():
        if OWN.fullmatch(file.name) and file.name not in written:
            file.unlink()
