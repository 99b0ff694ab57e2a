"""The job of `mcloc run`: make the run; write what it found, also where it breaks off."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mcloc.errors import ConfigError, LogError, McLocError

if TYPE_CHECKING:
    from mcloc.config import RunConfig
    from mcloc.localizer import Estimate
    from mcloc.report import Run
    from mcloc.report.animation import Snapshots


@dataclass(frozen=True)
class Job:
    """What the command line asks for. every: seconds between two checkpoints, or None. make: the
    run of a config, where it is another one than `Run`.
    """

    config: Path | None
    nav2_params: Path | None
    flags: dict[str, Any]
    particles: int | None
    assigned: dict[str, dict[str, str]]
    out: Path
    plot: bool
    gif: bool
    record: bool
    json: bool
    every: float | None
    resume: bool
    make: "Callable[[RunConfig], Run] | None" = None


def execute(job: Job) -> None:
    """Make the run. Raises McLocError, once what was found by then is written."""
    from mcloc.report import check_folder

    entries = _entries(job)
    check_folder(job.out)
    failure: BaseException | None = None
    recorded: list[Path] = []
    run: Run | None = None
    snapshots = _snapshots(job)
    try:
        run, every = _run(job, entries)
        for estimate in _estimates(job, run, every, recorded):
            if snapshots is not None:
                snapshots.add(estimate)
    except (McLocError, KeyboardInterrupt) as cause:
        failure = cause
    if run is not None and len(run.history):
        try:
            _write(job, run, snapshots, recorded)
        except McLocError as cause:
            raise failure or cause from None
        if failure is not None:
            last = run.history.last("t")
            typer.echo(f"results up to t = {last:.3f} s are in {job.out}", err=True)
    if failure is not None:
        raise failure


def _entries(job: Job) -> dict[str, Any]:
    """What is asked for, as arguments of RunConfig."""
    from mcloc.config import merged, read_entries
    from mcloc.config.nav2 import read_nav2

    entries: dict[str, Any] = {} if job.config is None else read_entries(job.config)
    if job.nav2_params is not None:
        taken, notes = read_nav2(job.nav2_params)
        entries = merged(entries, taken)
        for note in notes:
            typer.echo(f"{job.nav2_params}: {note}", err=True)
    entries = merged(entries, job.flags)
    if "initial_sigma" in job.flags and entries.get("initial") is None and not job.resume:
        raise ConfigError("--initial-sigma is about --initial: give both, or neither")
    return merged(entries, {"settings": job.assigned})


def _limited(job: Job, entries: dict[str, Any]) -> dict[str, Any]:
    """With as many particles as --particles says; what --set says wins."""
    from mcloc.config import limited, merged

    if job.particles is None:
        return entries
    return merged(limited(entries, job.particles), {"settings": job.assigned})


def _run(job: Job, entries: dict[str, Any]) -> tuple["Run", float | None]:
    """A new run, or the one to be resumed; and how often to save it."""
    from mcloc.config import RunConfig
    from mcloc.io.mrclam import Mrclam, is_mrclam
    from mcloc.report import Run, check_folder
    from mcloc.report.checkpoint import NAME, resume, saved_config

    saved = job.out / NAME
    if job.resume and saved.exists():
        config, every = saved_config(saved)
        _check_same(job, config, entries, saved)
        return resume(saved, entries.get("threads")), every if job.every is None else job.every
    if job.resume and not entries.get("log"):
        raise ConfigError(f"--resume: no run was saved in {job.out}; name its folder with --out")
    if job.resume:
        typer.echo(f"no run was saved in {job.out} yet: starting from its beginning", err=True)
    if "log" not in entries:
        raise ConfigError("which log? Give --log FILE, or --config with one in it")
    mapped = "map" in entries or "map" in entries.get("topics", {})
    if not mapped and not is_mrclam(entries["log"]):
        if not Path(entries["log"]).exists():
            raise LogError(f"{entries['log']}: there is no such file or folder")
        raise ConfigError(
            "which map? Give --map FILE, or --topic map=NAME for that of a bag, or --config with "
            "one in it"
        )
    if not mapped:
        Mrclam(entries["log"], entries.get("robot"))  # asks which robot, before anything is read
    config = RunConfig(**_limited(job, {"map": None, **entries}))
    inputs = config.map, config.log, config.truth, config.beacons, config.beacon_ranges
    check_folder(job.out, (*inputs, config.ceiling, config.images))
    run = Run(config) if job.make is None else job.make(config)
    saved.unlink(missing_ok=True)  # it is another run's
    return run, job.every


def _check_same(job: Job, saved: "RunConfig", entries: dict[str, Any], path: Path) -> None:
    """Nothing that was asked for may differ from the saved run: half of each would be neither."""
    from mcloc.config import RunConfig, merged

    if not entries.get("settings"):
        entries = {key: value for key, value in entries.items() if key != "settings"}
    ours = {f.name: getattr(saved, f.name) for f in fields(saved)}
    wanted = RunConfig(**_limited(job, merged(ours, entries))).resolved()
    for name, before, now in _differences(saved, wanted):
        raise ConfigError(
            f"--resume: {path} was made with {name} = {before!r}, now it is {now!r}; leave that "
            "option out, or start anew without --resume"
        )


def _differences(a: "RunConfig", b: "RunConfig") -> Iterator[tuple[str, Any, Any]]:
    """Names and values that differ and matter: threads change no result."""
    for f in fields(a):
        if f.name not in ("threads", "settings") and getattr(a, f.name) != getattr(b, f.name):
            yield f.name, getattr(a, f.name), getattr(b, f.name)
    for part, values in a.settings.items():
        for name, value in values.items():
            if b.settings[part][name] != value:
                yield f"{part}.{name}", value, b.settings[part][name]


def _estimates(
    job: Job, run: "Run", every: float | None, recorded: list[Path]
) -> Iterator["Estimate"]:
    """The run's estimates as they come, shown, recorded and saved on the way."""
    from mcloc.cli.progress import shown
    from mcloc.io.recording import Recording
    from mcloc.report.checkpoint import NAME, Checkpoints

    saves = None if every is None else Checkpoints(job.out / NAME, every)
    with ExitStack() as stack:
        show = stack.enter_context(shown())
        recording = None
        if job.record:
            recorded.append(_recording(job, run))
            recording = stack.enter_context(Recording(recorded[-1], run.grid))
        for estimates in run.by_event():
            for estimate in estimates:
                show(estimate)
                if recording is not None:
                    recording.add(estimate)
                yield estimate
            if saves is not None:
                saves.note(run)
        if saves is not None:
            saves.save(run)


def _recording(job: Job, run: "Run") -> Path:
    """Where to record: a resumed run records the rest of it beside what was recorded before."""
    if run.consumed == 0:
        return job.out / "recording"
    for name in itertools.chain(["recording"], (f"recording-{k}" for k in itertools.count(2))):
        # A run that was killed leaves its recording unfinished.
        if not any((job.out / part).exists() for part in (name, f".{name}.unfinished")):
            break
    typer.echo(f"recording from here on into {job.out / name}", err=True)
    return job.out / name


def _snapshots(job: Job) -> "Snapshots | None":
    from mcloc.report.animation import Snapshots

    return Snapshots() if job.gif else None


def _write(job: Job, run: "Run", snapshots: "Snapshots | None", recorded: list[Path]) -> None:
    from mcloc.cli.story import told
    from mcloc.report import write_run
    from mcloc.report.animation import animate
    from mcloc.report.summary import to_json
    from mcloc.storage import replacing

    summary = write_run(run, job.out, job.plot)
    pictures = [job.out / "run.png"] if job.plot else []
    if snapshots is not None and snapshots.kept:
        pictures.append(job.out / "run.gif")
        with replacing(pictures[-1]) as path:
            animate(run, snapshots, path)
    story = told(summary, job.out, [*pictures, *recorded])
    typer.echo(to_json(summary) if job.json else story, nl=False)
