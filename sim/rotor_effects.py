"""What rotors do to a vehicle beside thrust and torque: pure formulas.

Rotor drag. A rotor that is dragged sideways through the air at speed v resists with a force
along its plane of about k v, k growing with the rotor's speed (Mahony, Kumar, Corke,
"Multirotor Aerial Vehicles", IEEE Robotics and Automation Magazine 19 (3), 2012, equation 7;
Faessler, Franchi and Scaramuzza, "Differential Flatness of Quadrotor Dynamics Subject to Rotor
Drag", 2018, identify 0.4 to 0.5 per second of mass-specific drag, body included). Here k is
0.1 N s/m for a rotor in hover. On a vehicle that turns about its own axis the rotors' hubs move
at v = r d, so together they brake the turn by the moment k d^2 r each. JSBSim's rotors know
nothing of it; without it a vehicle that has lost a rotor would spin ever faster.

Ground effect. I. C. Cheeseman and W. E. Bennett, "The Effect of the Ground on a Helicopter
Rotor in Forward Flight", ARC R&M 3021, 1955: in hover, at constant power,

    T / T_free = 1 / (1 - (R / 4z)^2)

with the rotor's radius R and its height z. It is meant for z above R/2; below, the value at
R/2 is kept, 4/3.
"""

from typing import Final

from sim.truth import Motors

HUB_DISTANCE_M: Final = 0.2335
ROTOR_RADIUS_M: Final = 0.1194  # 9.4 inches across
ROTOR_ABOVE_CENTRE_M: Final = 0.025
HOVER_RPM: Final = 5065.0
DRAG_IN_HOVER_N_S_M: Final = 0.1
_LOWEST_HEIGHT_M: Final = 0.5 * ROTOR_RADIUS_M

_BRAKE_PER_RPM: Final = DRAG_IN_HOVER_N_S_M * HUB_DISTANCE_M**2 / HOVER_RPM


def yaw_brake_nm(rotor_rpm: Motors, yaw_rate_rad_s: float) -> float:
    """Moment [N m] about the body's down axis by which the rotors resist its turning."""
    total_rpm = rotor_rpm[0] + rotor_rpm[1] + rotor_rpm[2] + rotor_rpm[3]
    return -_BRAKE_PER_RPM * total_rpm * yaw_rate_rad_s


def ground_effect_factor(centre_height_m: float) -> float:
    """Thrust near the ground over thrust far from it, for a height of the centre of gravity."""
    height_m = max(centre_height_m + ROTOR_ABOVE_CENTRE_M, _LOWEST_HEIGHT_M)
    ratio = ROTOR_RADIUS_M / (4.0 * height_m)
    return 1.0 / (1.0 - ratio * ratio)
