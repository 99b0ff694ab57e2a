"""JSON knows no NaN."""

import json
import math

from mcloc.report.summary import known, to_json


def test_unknown_numbers_are_null() -> None:
    values = {"a": math.nan, "b": [math.inf, 1.0], "c": {"d": -math.inf}, "e": "x", "f": 2}
    wanted = {"a": None, "b": [None, 1.0], "c": {"d": None}, "e": "x", "f": 2}
    assert json.loads(to_json(known(values))) == wanted
