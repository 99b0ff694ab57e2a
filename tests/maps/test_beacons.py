"""Maps of radio beacons, and their files."""

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.maps.beacons import Beacons, read_beacons, write_beacons


def written(tmp_path, text):
    file = tmp_path / "beacons.csv"
    file.write_text(text)
    return file


def test_reads_names_and_places_whatever_the_order_of_the_columns(tmp_path):
    file = written(tmp_path, "# by hand\nz,beacon_id,x,y,note\n2.5,A7,1,-2,door\n\n1.0,3,0,4,\n")
    found = read_beacons(file)
    assert found.names == ("A7", "3")
    assert found.places.tolist() == [[1.0, -2.0, 2.5], [0.0, 4.0, 1.0]]
    assert found.name == str(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("beacon_id,x,y\n1,2,3\n", "line 1: the header lacks z; it must name beacon_id,x,y,z"),
        ("beacon_id,x,y,z\n1,2,3\n", "line 2: 4 fields expected, 3 found"),
        ("beacon_id,x,y,z\n1,2,three,4\n", "line 2: y must be a finite number.*'three'"),
        ("beacon_id,x,y,z\n1,2,inf,4\n", "line 2: y must be a finite number"),
        ("beacon_id,x,y,z\n1,2e9,3,4\n", "line 2: x must be a finite number below 1e\\+07"),
        ("beacon_id,x,y,z\n1,2,3,4\n1,2,3,5\n", "line 3: beacon 1 is there twice; remove one"),
        ("beacon_id,x,y,z\n", "there is no beacon in it"),
    ],
)
def test_what_is_no_map_of_beacons_is_refused_with_its_line(tmp_path, text, message):
    with pytest.raises(MapError, match=message):
        read_beacons(written(tmp_path, text))


def test_tables_have_to_fit():
    with pytest.raises(MapError, match="finite x, y, z"):
        Beacons(["a"], np.zeros((1, 2)))
    with pytest.raises(MapError, match="finite x, y, z"):
        Beacons(["a"], np.full((1, 3), np.nan))
    with pytest.raises(MapError, match="beacon a is there twice"):
        Beacons(["a", "a"], np.zeros((2, 3)))


def test_the_checksum_tells_beacons_apart():
    one = Beacons(["a"], np.zeros((1, 3)))
    assert one.checksum == Beacons(["a"], np.zeros((1, 3)), name="other file").checksum
    assert one.checksum != Beacons(["b"], np.zeros((1, 3))).checksum
    assert one.checksum != Beacons(["a"], np.ones((1, 3))).checksum


def test_beacons_are_read_as_they_were_written(tmp_path):
    made = Beacons(["1", "A7"], np.array([[1.5, -2.25, 0.0], [1e6, 3.125, 2.5]]))
    write_beacons(made, tmp_path / "beacons.csv")
    read = read_beacons(tmp_path / "beacons.csv")
    assert read.names == made.names
    assert read.places.tolist() == made.places.tolist()
    with pytest.raises(MapError, match="cannot be written"):
        write_beacons(made, tmp_path / "nowhere" / "beacons.csv")
