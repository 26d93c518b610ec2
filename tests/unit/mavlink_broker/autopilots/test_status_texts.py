"""Each status text that the broker acts on has one meaning, whichever case and suffix it has."""

import pytest

from mavlink_broker.autopilots.status_texts import TextMeaning, means

TEXTS = {
    "Flight plan received": TextMeaning.MISSION_UPLOADED,
    "No valid mission available, loitering\t": TextMeaning.MISSION_INVALID,
    "Reposition is outside geofence\t": TextMeaning.TARGET_OUTSIDE_GEOFENCE,
    "Preflight Fail: No connection to the ground contro": TextMeaning.NO_GROUND_STATION,
    "Preflight Fail: No connection to the GCS": TextMeaning.NO_GROUND_STATION,
    "Wind speed is above limit (12.0m/s)": TextMeaning.WIND_TOO_STRONG,
    "Low battery; Wind too strong: RETURN": TextMeaning.WIND_TOO_STRONG,
}


@pytest.mark.parametrize(("text", "meaning"), TEXTS.items())
def test_a_text_has_exactly_its_meaning(text: str, meaning: TextMeaning) -> None:
    assert [each for each in TextMeaning if means(text, each)] == [meaning]


@pytest.mark.parametrize(
    "text",
    [
        "Mission start denied! No valid mission",
        "Wind estimate reset; height limit reached",
        "Strong wind",
        "",
    ],
)
def test_other_texts_mean_nothing(text: str) -> None:
    assert not any(means(text, meaning) for meaning in TextMeaning)
