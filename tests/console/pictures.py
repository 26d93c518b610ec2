"""Pictures of the console: `python -m tests.console.pictures FOLDER` (`make screenshots`).

A system of two vehicles runs meanwhile: one flight has been flown, one is in the air, one plan is a
draft, an alarm is open. The pictures of each theme and language are in a folder of their own; those
that stand in the documentation are renewed in docs/pictures.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tests.support.browser import CONSOLE, sign_in_link
from tests.support.system import ROOT, FarmSystem, example_plan, running, short_plan

APPEARANCES: Final = (("light", "en"), ("dark", "en"), ("outdoor", "es"), ("light", "es"))
PEOPLE: Final = ("maria", "juan", "ana", "luis")
"""Who is signed in for each."""
DOCUMENTED: Final = {
    "fleet-desktop": "console-fleet",
    "sign_in-tablet": "console-sign-in",
    "stop-tablet": "console-stop",
    "field-tablet": "console-field",
    "survey-tablet": "console-survey",
    "plan-desktop": "console-plan",
    "editor-tablet": "console-editor",
    "flight-desktop": "console-flight",
    "alarms-tablet": "console-alarms",
}
"""Pictures of the first appearance that documents show, by their name there."""
COLOURS: Final = 96
"""The map and its labels have few colours: a palette makes a picture four times smaller."""
FIELD: Final = {
    "name": "North field",
    "boundary": [
        [40.44355, -3.73875],
        [40.44425, -3.73875],
        [40.44425, -3.73755],
        [40.44355, -3.73755],
    ],
}


def _plan(mission_id: int, vehicle_id: int, name: str, **more: Any) -> dict[str, Any]:
    """A round over the field, long enough to be looked at."""
    plan = short_plan(mission_id)
    mission = plan["missions"][0]
    mission["vehicle_id"] = vehicle_id
    mission["maximum_speed"] = 5
    first, _, last = mission["command_array"]
    first["parameters"]["altitude"] = 15.0
    corners = [(40.4437, -3.7386), (40.4441, -3.7386), (40.4441, -3.7377), (40.4437, -3.7377)]
    round_trip = [
        {
            "command_id": number,
            "command_type_id": 3,
            "parameters": {
                "latitude": latitude,
                "longitude": longitude,
                "altitude": 15.0 + 5 * (number % 3),
                "hold_time": 300.0 if number == 4 else 2.0,
            },
        }
        for number, (latitude, longitude) in enumerate(corners, start=2)
    ]
    mission["command_array"] = [first, *round_trip, {**last, "command_id": len(corners) + 2}]
    return {**plan, "name": name, **more}


def _prepare(farm: FarmSystem) -> None:
    """Fly once, leave a draft, leave a vehicle in the air."""
    for path, body in (
        ("/fields/", FIELD),
        ("/plans/", _plan(20, 2, "Evening round", dispatch=False)),
    ):
        answer = farm.post(path, body)
        assert answer.status_code == 201, answer.text
    farm.fly({**example_plan("eleven_commands"), "name": "Pictures of the yard"})
    with (farm.state_dir / "vehicle-2" / "faults.txt").open("a") as orders:
        orders.write("gps_loss duration_s=20\n")
    answer = farm.post("/plans/", _plan(30, 1, "Round over the north field"))
    assert answer.status_code == 201, answer.text


def _take(farm: FarmSystem, folder: Path, person: str, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    theme, language = folder.name.split("-")
    environment = {
        **os.environ,
        "CONSOLE_URL": f"{farm.settings.edge_url}/console/",
        "LINK": sign_in_link(farm, "admin", person).partition("#link=")[2],
        "THEME": theme,
        "LANGUAGE": language,
        "DRAFT": "1",
        "FLYING": "3",
    }
    script = CONSOLE / "tests" / "screens.mjs"
    subprocess.run(["node", script, folder, *names], env=environment, check=True)


def _document(folder: Path) -> None:
    for name, documented in DOCUMENTED.items():
        with Image.open(folder / f"{name}.png") as picture:
            small = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        small.save(ROOT / "docs" / "pictures" / f"{documented}.png", optimize=True)


def main() -> None:
    """Take the pictures."""
    parser = argparse.ArgumentParser(prog="tests.console.pictures", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the pictures go")
    parser.add_argument("screens", nargs="*", help="screens to take; all when none is named")
    arguments = parser.parse_args()
    # Ended from outside it leaves through `running`, which ends the system's programs
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(1))
    with tempfile.TemporaryDirectory() as state, running(Path(state), vehicles=2) as farm:
        _prepare(farm)
        for person, (theme, language) in zip(PEOPLE, APPEARANCES, strict=True):
            folder = arguments.folder / f"{theme}-{language}"
            shutil.rmtree(folder, ignore_errors=True)
            _take(farm, folder, person, arguments.screens)
            if not arguments.screens and (theme, language) == APPEARANCES[0]:
                _document(folder)


if __name__ == "__main__":
    main()
