"""What stops while a person looks at the console, against an edge server alone."""

from pathlib import Path

import pytest
from PIL import Image

from tests.support.browser import TEST_TIMEOUT_S, console_journey, link_at
from tests.support.system import free_ports
from tests.unit.edge_server.program import program_in


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_what_has_stopped_is_not_shown_as_live(tmp_path: Path) -> None:
    frame = tmp_path / "frame.jpg"
    Image.effect_noise((160, 120), 60).save(frame)
    (camera,) = free_ports(1)
    with console_journey(tmp_path) as take, program_in(tmp_path / "edge") as server:
        server.environment["VIDEO_STREAMS"] = f"1=http://127.0.0.1:{camera}/"
        server.start()
        headers = {"Authorization": f"Bearer {server.key('admin')}"}
        take(
            "notice_changes",
            ADMIN_LINK=link_at(server.url, headers, "admin", "ana"),
            BROKER_KEY=server.key("broker"),
            CAMERA_PORT=str(camera),
            FRAME=str(frame),
        )
