"""The CSV of measurements, also of those that an earlier version has stored."""

import csv
from typing import Any

import pytest

from afarcloud.numbers import LAST_SECOND
from edge_server.archive import observation_files


def rows_of(*result_times: int) -> list[dict[str, str]]:
    array: list[dict[str, Any]] = [
        {
            "resource_id": "thermometer",
            "observed_property": "air_temperature",
            "result_time": result_time,
            "result_value": 21.5,
            "result_uom": "Cel",
        }
        for result_time in result_times
    ]
    document = {"latitude": 40.0, "longitude": -3.0, "altitude": 5.0, "observation_array": array}
    return list(csv.DictReader(observation_files.write([document])))


@pytest.mark.parametrize("result_time", [LAST_SECOND + 1, 18_446_744_073_709, 2**63 - 1])
def test_a_time_beyond_the_calendar_is_left_out_and_the_file_goes_on(result_time: int) -> None:
    odd, plain = rows_of(result_time, 1_718_630_046)
    assert (odd["time"], odd["value"]) == ("", "21.5")
    assert plain["time"] == "2024-06-17T13:14:06Z"


def test_the_last_second_of_the_calendar_is_written() -> None:
    assert rows_of(LAST_SECOND)[0]["time"] == "9998-12-31T23:59:59Z"
