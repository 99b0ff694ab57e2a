"""What on the disk makes one bag: a file, a rosbag2 folder, or a folder of the pieces of one drive.

A file is told by its first bytes. A folder is read as its metadata.yaml says; without one (the
recorder was killed, or somebody split the drive) all its bag files count, in order of time.
"""

from dataclasses import dataclass
from pathlib import Path

from mcloc.errors import LogError

METADATA = "metadata.yaml"
ZSTD = b"\x28\xb5\x2f\xfd"


@dataclass(frozen=True)
class Kind:
    """One kind of bag. name: for messages. magic: how its files begin. suffix: how they are named.
    remedy: what mends a damaged one.
    """

    name: str
    magic: bytes
    suffix: str
    remedy: str


ROS1 = Kind("a ROS 1 bag", b"#ROSBAG V", ".bag", "`rosbag reindex FILE`")
MCAP = Kind("an MCAP file", b"\x89MCAP0\r\n", ".mcap", "`mcap recover FILE -o MENDED.mcap`")
SQLITE = Kind(
    "a ROS 2 sqlite3 bag", b"SQLite format 3\0", ".db3", "`sqlite3 FILE .recover | sqlite3 NEW.db3`"
)
FOLDER = Kind("a ROS 2 bag", b"", "", "`ros2 bag reindex FOLDER`")
FILES = (ROS1, MCAP, SQLITE)


@dataclass(frozen=True)
class BagFiles:
    """path: as the user gave it. kind: of all parts. parts: files or one folder, each to be opened
    by itself.
    """

    path: Path
    kind: Kind
    parts: tuple[Path, ...]


def find_bag(path: str | Path) -> BagFiles | None:
    """The bag at a path, or None for what is no folder and does not begin like a bag.

    Raises LogError for a folder without a bag, and for a bag that is compressed as a whole, named
    misleadingly or left open by its recorder.
    """
    path = Path(path)
    try:
        found = _in_folder(path) if path.is_dir() else _by_content(path)
        if found is not None:
            _refuse_unfinished(found)
        return found
    except OSError as cause:
        raise LogError(f"{path}: cannot be opened ({cause.strerror})") from cause


def _by_content(path: Path) -> BagFiles | None:
    if not path.is_file():  # to open a pipe could wait for ever
        return None
    with path.open("rb") as stream:
        head = stream.read(16)
    if head.startswith(ZSTD):
        raise LogError(
            f"{path}: is compressed as a whole; unpack it with `zstd -d`, or give the bag's folder "
            f"with its {METADATA}"
        )
    kind = next((kind for kind in FILES if head.startswith(kind.magic)), None)
    if kind is None:
        return None
    if kind is not ROS1 and path.suffix != kind.suffix:  # rosbags goes by the suffix
        raise LogError(f"{path}: is {kind.name}; let its name end in {kind.suffix}")
    return BagFiles(path, kind, (path,))


def _in_folder(path: Path) -> BagFiles:
    if (path / METADATA).is_file():
        return BagFiles(path, FOLDER, (path,))
    names = sorted(path.iterdir())
    kinds = [kind for kind in FILES if any(name.suffix == kind.suffix for name in names)]
    if not kinds:
        raise LogError(
            f"{path}: is a directory without a bag in it; give a log file, or a folder with "
            f"{METADATA}, *.mcap, *.db3 or *.bag (compressed files need their {METADATA})"
        )
    if len(kinds) > 1:
        raise LogError(
            f"{path}: holds bags of several kinds ({', '.join(k.suffix for k in kinds)}); give one "
            "file or a folder with one bag"
        )
    (kind,) = kinds
    return BagFiles(path, kind, tuple(name for name in names if name.suffix == kind.suffix))


def _refuse_unfinished(bag: BagFiles) -> None:
    """What sqlite keeps beside a file that was not closed is part of it, and not to be touched: to
    merge it would write into the recording, and to read without it would lose the end.
    """
    folder = bag.path if bag.path.is_dir() else bag.path.parent
    files = folder.glob("*.db3") if bag.kind is FOLDER else bag.parts
    for file in files:
        for ending in ("-wal", "-journal"):
            beside = Path(f"{file}{ending}")
            if file.suffix == SQLITE.suffix and beside.is_file() and beside.stat().st_size > 0:
                raise LogError(
                    f"{file}: was not closed by its recorder, {beside.name} holds a part of it; "
                    'in a copy of both, run `sqlite3 FILE "PRAGMA integrity_check"` to merge them'
                )
