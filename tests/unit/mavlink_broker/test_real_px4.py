"""What PX4 does otherwise than expected, by its sources; see also `test_real_autopilots.py`.

`Commander.cpp`, `failsafe.cpp`, `navigator_main.cpp`, `mavlink_receiver.cpp`.
"""

import dataclasses

from afarcloud.enumerations import Status
from mavlink_broker.dialect import mavlink
from tests.support.broker_world import World, first_flight
from tests.support.real_autopilots import PX4_1_17


class TestAVehicleThatIsNotReady:
    def test_is_asked_why(self) -> None:
        """It says why once, when that begins: mostly before there is a broker or a mission."""
        fault = "Preflight Fail: Compass 0 uncalibrated"
        script = dataclasses.replace(PX4_1_17, ready_to_arm_after_s=1e6, fault=fault)
        world = World()
        vehicle = world.add_vehicle(script=script)
        world.edge.plan(first_flight())
        world.run_until_over(1201)
        assert world.edge.status(1201) == Status.FAILED
        assert fault in world.edge.reports(1201)[-1]["message"]
        asked = vehicle.commands.count(mavlink.MAV_CMD_RUN_PREARM_CHECKS)
        assert 1 < asked < 6
