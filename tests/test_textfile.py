"""Text files: plain or gzip, whole or damaged; what is wrong is said with path and line."""

import gzip
import os

import pytest

from mcloc.errors import LogError, MapError
from mcloc.textfile import HEAD, LONGEST_LINE, TextFile


def write(path, content):
    path.write_bytes(content)
    return TextFile(str(path), LogError)


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_lines_are_numbered_from_one_whatever_the_compression_and_the_name(tmp_path, pack):
    text = write(tmp_path / "any.name", pack(b"one\r\ntwo\n\nfour"))
    assert list(text.lines()) == [(1, "one\n"), (2, "two\n"), (3, "\n"), (4, "four")]


def test_a_byte_order_mark_is_no_part_of_the_first_line(tmp_path):
    assert list(write(tmp_path / "a", "\ufeffO 1".encode()).lines()) == [(1, "O 1")]


def test_bytes_that_are_no_text_do_not_stop_the_reading(tmp_path):
    assert len(list(write(tmp_path / "a", b"\xff\xfe\n\x00\n").lines())) == 2


def test_head_is_the_first_lines_only(tmp_path):
    head = write(tmp_path / "a", b"0123456789\n" * 100_000).head()
    assert HEAD <= sum(map(len, head)) < HEAD + 12


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_an_empty_file_is_said_to_be_empty(tmp_path, pack):
    with pytest.raises(LogError, match=r"log\.txt: the file is empty"):
        write(tmp_path / "log.txt", pack(b"")).head()


def test_what_is_no_file_raises_the_error_asked_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, reason in [
        (tmp_path / "missing", "No such file"),
        (tmp_path, "is a directory"),
        (tmp_path / "pipe", "not a regular file"),
        (tmp_path / ("x" * 5000), "name too long"),
        ("nul\0", "null byte|null character"),
    ]:
        with pytest.raises(MapError, match=reason):
            TextFile(str(path), MapError).head()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(tmp_path):
    text = write(tmp_path / "secret", b"O 1")
    (tmp_path / "secret").chmod(0)
    with pytest.raises(LogError, match="Permission denied"):
        text.head()


def test_lines_before_the_cut_of_a_gzip_file_are_delivered(tmp_path):
    lines = b"".join(os.urandom(30).hex().encode() + b"\n" for _ in range(20_000))
    packed = gzip.compress(lines)
    text = write(tmp_path / "cut.gz", packed[: len(packed) // 2])
    read = []
    with pytest.raises(LogError, match=r"cut\.gz, line \d+: cut or damaged") as raised:
        read.extend(text.lines())
    assert 9_000 < len(read) < 11_000
    assert f"line {len(read) + 1}:" in str(raised.value)
    assert text.head()[0].encode() == lines[:61]


def test_a_damaged_checksum_is_noticed(tmp_path):
    packed = bytearray(gzip.compress(b"O 1\nO 2\n"))
    packed[-8] ^= 1
    with pytest.raises(LogError, match="CRC"):
        list(write(tmp_path / "a.gz", bytes(packed)).lines())


def test_a_line_without_end_is_not_read_into_memory(tmp_path):
    text = write(tmp_path / "a.gz", gzip.compress(b"x" * (3 * LONGEST_LINE)))
    with pytest.raises(LogError, match="line 1: too long"):
        list(text.lines())
