from uav_firmware.bus import Fork, Queue, Topic


def test_a_topic_holds_the_newest_value_and_counts() -> None:
    topic: Topic[str] = Topic()
    assert (topic.value, topic.count) == (None, 0)
    topic.publish("first")
    topic.publish("second")
    assert (topic.value, topic.count) == ("second", 2)


def test_a_queue_gives_everything_once_in_order() -> None:
    queue: Queue[int] = Queue()
    for number in range(5):
        queue.publish(number)
    assert queue.drain() == [0, 1, 2, 3, 4]
    assert queue.drain() == []


def test_the_oldest_item_of_a_queue_is_removed_alone() -> None:
    queue: Queue[int] = Queue()
    assert queue.pop() is None
    queue.publish(1)
    queue.publish(2)
    assert queue.pop() == 1
    assert queue.drain() == [2]


def test_a_full_queue_loses_the_oldest_and_counts_it() -> None:
    queue: Queue[int] = Queue(limit=3)
    for number in range(5):
        queue.publish(number)
    assert queue.drain() == [2, 3, 4]
    assert queue.dropped == 2


def test_both_readers_of_a_fork_get_everything() -> None:
    fork: Fork[int] = Fork()
    fork.publish(1)
    assert fork.drain() == [1]
    fork.publish(2)
    assert fork.drain() == [2]
    assert fork.second.drain() == [1, 2]
