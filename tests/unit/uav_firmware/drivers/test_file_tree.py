import errno
import os
import shutil
import tempfile
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from uav_firmware.cal.files import OpenMode
from uav_firmware.drivers.file_room import REFUSALS_PER_MEASUREMENT, Content, Room, measure
from uav_firmware.drivers.file_tree import FileTree

READ, CREATE, WRITE = OpenMode.READ, OpenMode.CREATE, OpenMode.WRITE


def refused(code: int) -> "pytest.RaisesExc[OSError]":
    return pytest.raises(OSError, match=os.strerror(code))


def put(tree: FileTree, name: str, contents: bytes, mode: OpenMode = CREATE) -> None:
    file = tree.open((name,), mode)
    try:
        file.write(0, contents)
    finally:
        file.close()


def test_a_tree_that_was_never_used_is_empty(tmp_path: Path) -> None:
    assert list(FileTree(tmp_path / "new").entries(())) == []


def test_entries_are_sorted_and_told_apart(tmp_path: Path) -> None:
    (tmp_path / "b").write_bytes(b"123")
    (tmp_path / "a").mkdir()
    (tmp_path / "link").symlink_to("b")
    os.mkfifo(tmp_path / "pipe")
    found = [(e.name, e.is_folder, e.size, e.is_plain) for e in FileTree(tmp_path).entries(())]
    assert found == [
        ("a", True, 0, True),
        ("b", False, 3, True),
        ("link", False, 0, False),
        ("pipe", False, 0, False),
    ]


@pytest.mark.parametrize("mode", list(OpenMode))
def test_links_and_pipes_are_not_opened(tmp_path: Path, mode: OpenMode) -> None:
    (tmp_path / "secret").write_bytes(b"x")
    tree = FileTree(tmp_path / "tree")
    (tmp_path / "tree").mkdir()
    (tmp_path / "tree" / "link").symlink_to("../secret")
    (tmp_path / "tree" / "up").symlink_to("..")
    os.mkfifo(tmp_path / "tree" / "pipe")
    for place in (("link",), ("up", "secret"), ("pipe",)):
        with pytest.raises(OSError):  # noqa: PT011 - each kind has its own number
            tree.open(place, mode)
    assert (tmp_path / "secret").read_bytes() == b"x"


def test_a_tree_that_may_not_be_written_can_be_read_and_cleared(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"123")
    tree = FileTree(tmp_path, may_write=False)
    for mode in (CREATE, WRITE):
        with refused(errno.EROFS):
            tree.open(("a",), mode)
    with refused(errno.EROFS):
        tree.truncate(("a",), 0)
    with refused(errno.EROFS):
        tree.make_folder(("d",))
    with refused(errno.EROFS):
        tree.rename(("a",), ("b",))
    with closing(tree.open(("a",), READ)) as file:
        assert file.read(0, 10) == b"123"
    tree.remove(("a",))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_read_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"123")
    with closing(FileTree(tmp_path).open(("a",), READ)) as file, refused(errno.EACCES):
        file.write(0, b"x")


def test_room_that_others_have_made_is_found(tmp_path: Path) -> None:
    tree = FileTree(tmp_path, bytes_max=100)
    put(tree, "a", bytes(100))
    with refused(errno.ENOSPC):
        put(tree, "b", b"x")
    (tmp_path / "a").unlink()
    for _ in range(REFUSALS_PER_MEASUREMENT):
        with suppress(OSError):
            put(tree, "b", bytes(100))
    assert tree.room.taken == measure(tmp_path)
    assert (tmp_path / "b").stat().st_size == 100


def test_who_asks_in_vain_does_not_make_the_folder_be_looked_through() -> None:
    looks = []

    def look() -> Content:
        looks.append(1)
        return Content(bytes=100, entries=1)

    room = Room(100, 10, look)
    for _ in range(REFUSALS_PER_MEASUREMENT):
        with refused(errno.ENOSPC):
            room.demand(1)
    assert len(looks) == 2  # At the beginning, and once more


def test_to_create_again_gives_back_what_the_file_took(tmp_path: Path) -> None:
    tree = FileTree(tmp_path, bytes_max=100)
    for _ in range(5):
        put(tree, "a", bytes(80))
    assert tree.room.taken == measure(tmp_path)


NAMES = st.sampled_from(["a", "b", "c"])
SIZES = st.integers(0, 60)


class TreeMachine(RuleBasedStateMachine):
    """Whatever is done, the count is right and the limits hold."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.tree = FileTree(self.folder, bytes_max=100, entries_max=2)
        self.tree.room.demand()

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    @rule(name=NAMES, size=SIZES, offset=SIZES, mode=st.sampled_from([CREATE, WRITE]))
    def write(self, name: str, size: int, offset: int, mode: OpenMode) -> None:
        try:
            file = self.tree.open((name,), mode)
        except OSError:
            return
        self._try(lambda: file.write(offset, bytes(size)))
        file.close()

    @rule(name=NAMES, size=SIZES)
    def truncate(self, name: str, size: int) -> None:
        self._try(lambda: self.tree.truncate((name,), size))

    @rule(name=NAMES)
    def remove(self, name: str) -> None:
        self._try(lambda: self.tree.remove((name,)))

    @rule(name=NAMES)
    def make_folder(self, name: str) -> None:
        self._try(lambda: self.tree.make_folder((name,)))

    @rule(name=NAMES)
    def remove_folder(self, name: str) -> None:
        self._try(lambda: self.tree.remove_folder((name,)))

    @rule(old=NAMES, new=NAMES)
    def rename(self, old: str, new: str) -> None:
        self._try(lambda: self.tree.rename((old,), (new,)))

    @invariant()
    def the_count_is_right(self) -> None:
        content = measure(self.folder)
        assert self.tree.room.taken == content
        assert content.bytes <= 100
        assert content.entries <= 2

    def _try(self, action: Callable[[], None]) -> None:
        with suppress(OSError):  # Refused or not, the count must be right
            action()


TestTree = TreeMachine.TestCase
