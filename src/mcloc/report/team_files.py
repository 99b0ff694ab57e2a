"""The folder of results of a team."""

from pathlib import Path

from mcloc.io.tum import write_tum
from mcloc.report.summary import to_json
from mcloc.report.team_picture import draw_team
from mcloc.report.team_run import TeamRun
from mcloc.storage import replacing


def write_team(run: TeamRun, folder: Path, plot: bool = True) -> None:
    """Write summary.json, for each robot N that ever had a place robotN.csv and robotN.tum, and
    team.png, of which each is replaced as a whole. Raises McLocError where that cannot be.
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
