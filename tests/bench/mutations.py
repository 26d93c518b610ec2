"""Break forty laws of the four programs one at a time: `python -m tests.bench.mutations`.

Each law is broken by one change of a line in a copy of the project; the tests named beside it,
which `make test` runs, must fail. A break that no test notices is printed, and so is a line that
is not found any more. Arguments choose laws by a part of their file's path. Exit code 0: every
break was noticed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[2]
_PARTS: Final = (
    "afarcloud", "deploy", "docs", "dst", "edge_server", "examples", "farm_flight_bridge",
    "mavlink_broker", "sim", "tests", "uav_firmware", "pyproject.toml", "Makefile", "README.md",
)  # fmt: skip
_LONGEST_S: Final = 600.0


class Break(NamedTuple):
    """One law, and how it is broken."""

    law: str
    file: str
    line: str  # A part of the file that occurs once
    broken: str
    tests: str  # Separated by blanks


_EDGE: Final = "tests/unit/edge_server"
_BROKER: Final = "tests/unit/mavlink_broker"
_MODULES: Final = "tests/unit/uav_firmware/modules"
BREAKS: Final = (
    Break(
        "a repeated report belongs to the ended mission, not to a new one of the same number",
        "edge_server/services/fleet/report_matching.py",
        "(repeated, accepted, ended)",
        "(accepted, ended, repeated)",
        f"{_EDGE}/api/routes/reports/test_mission_reports.py",
    ),
    Break(
        "a retry waits no longer than the longest pause",
        "edge_server/outbox/retry.py",
        "min(self.cap_s, self.base_s",
        "max(self.cap_s, self.base_s",
        f"{_EDGE}/outbox/test_retry.py {_EDGE}/outbox",
    ),
    Break(
        "202 Accepted does not confirm a record",
        "edge_server/outbox/answers.py",
        "{200, 201, 203, 204, 205}",
        "{200, 201, 202, 203, 204, 205}",
        f"{_EDGE}/outbox/test_answers.py",
    ),
    Break(
        "a page of a foreign server does not confirm a record",
        "edge_server/outbox/answers.py",
        "return not answer.body.strip() or",
        "return True or",
        f"{_EDGE}/outbox/test_answers.py",
    ),
    Break(
        "alarms and reports are stored while other records are refused for lack of space",
        "edge_server/outbox/budget.py",
        "now < Level.DROPPING or (kind in URGENT and now < Level.FULL)",
        "now < Level.DROPPING",
        f"{_EDGE}/outbox {_EDGE}/services",
    ),
    Break(
        "thinning keeps one record per interval",
        "edge_server/outbox/budget.py",
        "if interval == last_kept:",
        "if interval != last_kept:",
        f"{_EDGE}/outbox",
    ),
    Break(
        "a row in flight is sent again after a crash",
        "edge_server/outbox/queue.py",
        "(State.IN_FLIGHT, Trigger.CRASHED): State.QUEUED",
        "(State.IN_FLIGHT, Trigger.CRASHED): State.GONE",
        f"{_EDGE}/outbox",
    ),
    Break(
        "a bulk holds at most 500 reports",
        "edge_server/api/schemas.py",
        "MOST_RECORDS: Final = 500",
        "MOST_RECORDS: Final = 501",
        f"{_EDGE}/api/routes/reports/test_bulk.py",
    ),
    Break(
        "an expired signature is refused",
        "edge_server/api/access/jws.py",
        "if now >= expires_at:",
        "if now >= expires_at + 3600.0:",
        f"{_EDGE}/api/access/test_signatures.py",
    ),
    Break(
        "a signature for another edge server is refused",
        "edge_server/api/access/jws.py",
        "if self._edge_id not in audiences:",
        "if not audiences:",
        f"{_EDGE}/api/access/test_signatures.py",
    ),
    Break(
        "an Idempotency-Key with another body is refused",
        "edge_server/services/post_idempotency.py",
        "(found.route, found.body_sha256) != (route, body_sha256)",
        "found.route != route",
        f"{_EDGE}/services {_EDGE}/api/routes",
    ),
    Break(
        "one address holds no more connections than its limit",
        "edge_server/connections/admission.py",
        "if open_by_network[newest] >= limits.per_address:",
        "if open_by_network[newest] > limits.per_address:",
        f"{_EDGE}/connections",
    ),
    Break(
        "a vehicle that failed in the air is held",
        "edge_server/services/fleet/vehicle_holds.py",
        "AIRBORNE_M: Final = 2.0",
        "AIRBORNE_M: Final = 2000.0",
        f"{_EDGE}/api/routes/fleet/test_vehicle_holds.py",
    ),
    Break(
        "a mode that somebody else chose is a takeover",
        "mavlink_broker/vehicle/control_authority.py",
        "return Authority.FAILSAFE if seen.in_failsafe else Authority.OTHERS",
        "return Authority.BROKER",
        f"{_BROKER}/takeovers/test_takeover.py",
    ),
    Break(
        "an abort on the ground keeps the vehicle there",
        "mavlink_broker/mission/abort_executor.py",
        "return is_about_to_arm or self._vehicle.is_standing_armed",
        "return is_about_to_arm",
        f"{_BROKER}/takeovers/test_taken_vehicles.py {_BROKER}/mission",
    ),
    Break(
        "an abort without a position lands at once",
        "mavlink_broker/mission/abort_executor.py",
        "if self._lands_instead or self._lacks_position:",
        "if self._lands_instead:",
        f"{_BROKER}/takeovers/test_taken_vehicles.py",
    ),
    Break(
        "no lane of the outbox starves",
        "mavlink_broker/edge/outbox.py",
        "if self._turns % LONGEST_WAITING_EVERY == 0:",
        "if self._turns < 0:",
        f"{_BROKER}/edge/test_outbox.py",
    ),
    Break(
        "a vehicle's reports wait for its registration",
        "mavlink_broker/edge/outbox.py",
        "if not needs_registration or lane.vehicle_id in self._registered:",
        "if True:",
        f"{_BROKER}/edge/test_outbox.py",
    ),
    Break(
        "a replayed frame is refused",
        "mavlink_broker/mavlink/signing.py",
        "return Refusal.REPLAYED",
        "return None",
        f"{_BROKER}/mavlink tests/contract/test_signing.py",
    ),
    Break(
        "two vehicles with one system id are reported",
        "mavlink_broker/routing/link_selection.py",
        "CLOCK_DIFFERENCE_MS: Final = 10_000",
        "CLOCK_DIFFERENCE_MS: Final = 10_000_000",
        f"{_BROKER}/routing",
    ),
    Break(
        "a series without pictures is not done",
        "mavlink_broker/live/camera_state.py",
        "CaptureState.DONE if self.pictures else CaptureState.NOT_DONE",
        "CaptureState.DONE",
        f"{_BROKER}/live",
    ),
    Break(
        "a waypoint that somebody skipped is reported",
        "mavlink_broker/mission/integrity.py",
        "if self._is_proven and left:",
        "if self._is_proven and not left:",
        f"{_BROKER}/mission",
    ),
    Break(
        "an item that is requested twice is sent twice",
        "mavlink_broker/microservices/mission_upload.py",
        "if self._repetitions <= MOST_REPETITIONS:",
        "if self._repetitions <= 0:",
        f"{_BROKER}/microservices tests/contract/test_mission_clients.py",
    ),
    Break(
        "an autopilot that climbs straight up gets the waypoint of its take-off",
        "mavlink_broker/planning/flight_commands.py",
        "items = (climb, *_yaw_before(p.yaw_angle, family), go)",
        "items = (climb,)",
        f"{_BROKER}/planning tests/golden/test_translation.py",
    ),
    Break(
        "a take-off below 1 m is refused",
        "afarcloud/flyable.py",
        "LOWEST_TAKEOFF_M: Final = 1.0",
        "LOWEST_TAKEOFF_M: Final = 0.1",
        "tests/unit/afarcloud/test_flyable.py",
    ),
    Break(
        "nothing is flown behind a landing",
        "afarcloud/flyable.py",
        "flies_since, landed_at = None, index",
        "flies_since, landed_at = None, None",
        "tests/unit/afarcloud/test_flyable.py",
    ),
    Break(
        "a plan that leaves its geofence is refused",
        "afarcloud/rules.py",
        "faults += fence.missions[index]",
        "faults += ()",
        "tests/unit/afarcloud",
    ),
    Break(
        "a measurement beyond its gate is not fused",
        "uav_firmware/modules/estimator/kalman_filter/gate.py",
        "if self.ratio > 1.0:",
        "if self.ratio > 100.0:",
        f"{_MODULES}/estimator",
    ),
    Break(
        "a source that disagrees for long is stopped",
        "uav_firmware/modules/estimator/kalman_filter/gate.py",
        "self._stopped or self._doubt_s > STOP_AFTER_S",
        "self._stopped",
        f"{_MODULES}/estimator",
    ),
    Break(
        "a stopped source agrees for two seconds before it is used again",
        "uav_firmware/modules/estimator/kalman_filter/gate.py",
        "* 1e-6 >= RESUME_AFTER_S",
        "* 1e-6 >= 0.0",
        f"{_MODULES}/estimator",
    ),
    Break(
        "a vehicle whose rotors carry it does not stand",
        "uav_firmware/modules/land_detector/signs.py",
        "seen.thrust <= limits.thrust",
        "seen.thrust <= 1.0",
        f"{_MODULES}/land_detector",
    ),
    Break(
        "a failsafe that was waiting is acted upon when the stronger one is over",
        "uav_firmware/modules/commander/failsafe/machine.py",
        "_worst_first(self._present - self._overridden, moment)",
        "_worst_first(self._present - before, moment)",
        f"{_MODULES}/commander",
    ),
    Break(
        "two standing rotors of a vehicle at rest are a crash",
        "uav_firmware/modules/failure_detector/crash_detector.py",
        "if seen.failed_motors > 1:",
        "if seen.failed_motors > 4:",
        f"{_MODULES}/failure_detector",
    ),
    Break(
        "thrust moves by a bounded amount to make room for yaw",
        "uav_firmware/modules/control_allocator/allocation.py",
        "_YAW_THRUST_MARGIN = 0.15",
        "_YAW_THRUST_MARGIN = 1.0",
        f"{_MODULES}/control_allocator",
    ),
    Break(
        "the vertical speed keeps its limits",
        "uav_firmware/modules/position_control/controller.py",
        "down = min(max(down, -limits.speed_up), limits.speed_down)",
        "down = max(down, -limits.speed_up)",
        f"{_MODULES}/position_control",
    ),
    Break(
        "the integral does not wind up while the thrust is cut",
        "uav_firmware/modules/position_control/controller.py",
        "down += i_z * (error[2] - back_z * (asked[2] - given[2])) * dt",
        "down += i_z * error[2] * dt",
        f"{_MODULES}/position_control",
    ),
    Break(
        "a battery holds no more than what the current has left",
        "uav_firmware/modules/battery/charge.py",
        "min(blended, by_current, 1.0)",
        "min(blended, 1.0)",
        f"{_MODULES}/battery",
    ),
    Break(
        "airspeed and drag are each other's inverse",
        "uav_firmware/lib/drag.py",
        "return 2.0 * drag_m_s2 / (linear + root)",
        "return drag_m_s2 / (linear + root)",
        "tests/unit/uav_firmware/lib/test_drag.py",
    ),
    Break(
        "the wind is weaker near the ground",
        "sim/physics/wind.py",
        "return math.log(height_ft / _ROUGHNESS_FT) / _LOG_OF_REFERENCE",
        "return height_ft / height_ft",
        "tests/unit/sim/physics",
    ),
    Break(
        "a fix arrives as late as its receiver takes",
        "sim/sensors/gps.py",
        "self._pending[0].time_us + DELAY_US <= time_us",
        "self._pending[0].time_us <= time_us",
        "tests/unit/sim/sensors",
    ),
)  # fmt: skip


def main(chosen: list[str]) -> int:
    """Break each chosen law; 0 if tests fail by each."""
    unnoticed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in _PARTS:
            source = ROOT / part
            ignored = shutil.ignore_patterns("__pycache__", "var")
            if source.is_dir():
                shutil.copytree(source, copy / part, ignore=ignored)
            else:
                shutil.copy(source, copy / part)
        breaks = [one for one in BREAKS if not chosen or any(part in one.file for part in chosen)]
        for number, one in enumerate(breaks, start=1):
            outcome = _break(copy, one)
            unnoticed += outcome is not None
            sys.stdout.write(f"{number:2} {outcome or 'noticed'}: {one.law}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{len(breaks) - unnoticed} of {len(breaks)} broken laws are noticed\n")
    return int(unnoticed > 0)


def _break(copy: Path, one: Break) -> str | None:
    """Run the tests of one broken law; what is wrong if they pass."""
    file = copy / one.file
    text = file.read_text()
    if text.count(one.line) != 1:
        return f"NOT FOUND ONCE in {one.file}"
    file.write_text(text.replace(one.line, one.broken))
    try:
        tests = [test for test in one.tests.split() if (copy / test).exists()]
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        run = subprocess.run(
            [*command, "-m", "not thorough", *tests],
            cwd=copy,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "CI": "true"},
            capture_output=True,
            text=True,
            timeout=_LONGEST_S,
            check=False,
        )
    finally:
        file.write_text(text)
    if run.returncode == 0:
        return "NOT NOTICED"
    is_failed = run.returncode == 1 and " failed" in run.stdout
    return None if is_failed else f"TESTS DO NOT RUN: {run.stdout[-500:]}{run.stderr[-500:]}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Break forty laws, one at a time.")
    parser.add_argument("part", nargs="*", help="of the file of a law; without one all laws")
    sys.exit(main(parser.parse_args().part))
