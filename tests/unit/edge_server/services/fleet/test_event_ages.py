"""The ages of events by a clock that nobody sets."""

from edge_server.services.fleet.event_ages import EventAges


def test_the_age_of_an_event_is_what_has_passed_since_it_was_noted() -> None:
    now_s = 100.0
    ages = EventAges(lambda: now_s)
    ages.note(7)
    now_s = 104.5
    ages.note(8)
    assert (ages.age_s(7), ages.age_s(8), ages.age_s(9)) == (4.5, 0.0, None)


def test_an_event_that_has_ended_is_forgotten() -> None:
    ages = EventAges(lambda: 0.0)
    for work_id in range(5):
        ages.note(work_id)
    ages.keep_only([3, 9])
    assert [ages.age_s(work_id) for work_id in range(5)] == [None, None, None, 0.0, None]
