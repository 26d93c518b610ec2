"""What rotors do to a vehicle beside thrust and torque: pure formulas.

Rotor drag. A rotor whose hub moves through the air with the velocity v_p in the rotor's plane
resists with a force in that plane, the H-force,

    F = -c rho Omega v_p

linear in airspeed and in rotor speed: induced drag of stiff blades, flapping and profile drag
together (Mahony, Kumar, Corke, "Multirotor Aerial Vehicles", IEEE Robotics and Automation
Magazine 19 (3), 2012, section "Blade Flapping and Induced Drag"; Martin and Salaun, "The True
Role of Accelerometer Feedback in Quadrotor Control", ICRA 2010). Gazebo's motor model, which
PX4's simulated vehicles fly with, has the same law (`rotorDragCoefficient` times rotor speed
times velocity across the axis). JSBSim's rotors do not model it.

The coefficient c is fixed by 0.1 N s/m for one rotor in hover at home, 650 m. Four rotors and
1.4 kg make 0.286 1/s, PX4's EKF2_MCOEF at that density; Faessler, Franchi and Scaramuzza
("Differential Flatness of Quadrotor Dynamics Subject to Rotor Drag", 2018) identify 0.4 to 0.5
1/s, body included. In a hover Omega grows with 1 / sqrt(rho), so that the drag falls with
sqrt(rho), as PX4's drag model has it.

A hub's velocity holds the body's rotation too: rotors brake roll, pitch and yaw. Without the
brake about yaw a vehicle that has lost a rotor would spin ever faster.

Ground effect. I. C. Cheeseman and W. E. Bennett, "The Effect of the Ground on a Helicopter
Rotor in Forward Flight", ARC R&M 3021, 1955: in hover, at constant power,

    T / T_free = 1 / (1 - (R / 4z)^2)

with the rotor's radius R and its height z. It is meant for z above R/2; below, the value at
R/2 is kept, 4/3.
"""

from typing import Final

from sim.physics.truth import Motors, Vector3

ARM_M: Final = 0.1651  # Of a hub along the forward and along the right axis
ROTOR_RADIUS_M: Final = 0.1194  # 9.4 inches across
ROTOR_ABOVE_CENTRE_M: Final = 0.025
HOVER_RPM: Final = 5065.0
HOVER_DENSITY_KG_M3: Final = 1.150  # Standard atmosphere at home, 650 m
DRAG_IN_HOVER_N_S_M: Final = 0.1
_LOWEST_HEIGHT_M: Final = 0.5 * ROTOR_RADIUS_M

_DRAG_PER_RPM: Final = DRAG_IN_HOVER_N_S_M / (HOVER_RPM * HOVER_DENSITY_KG_M3)


def rotor_drag(
    rotor_rpm: Motors, air_velocity_frd: Vector3, rate_frd: Vector3, density_kg_m3: float
) -> tuple[float, float, float]:
    """H-force of four rotors at (+-ARM_M, +-ARM_M): forward [N], right [N], yaw moment [N m].

    The forces act at the hubs' height, ROTOR_ABOVE_CENTRE_M above the centre of gravity.

    `air_velocity_frd` is the velocity [m/s] of the centre of gravity through the air, body FRD;
    `rate_frd` that of the body's rotation [rad/s]. The down component of the velocity does not
    count: inflow along the axis is part of the propeller's thrust.
    """
    front_right, rear_left, front_left, rear_right = rotor_rpm
    scale = _DRAG_PER_RPM * density_kg_m3
    total = scale * (front_right + rear_left + front_left + rear_right)
    # Coefficient times place, summed over the hubs: forward and right
    ahead = scale * ARM_M * (front_right + front_left - rear_left - rear_right)
    aside = scale * ARM_M * (front_right + rear_right - rear_left - front_left)
    p, q, r = rate_frd
    forward = air_velocity_frd[0] - q * ROTOR_ABOVE_CENTRE_M
    right = air_velocity_frd[1] + p * ROTOR_ABOVE_CENTRE_M
    return (
        r * aside - total * forward,
        -r * ahead - total * right,
        forward * aside - right * ahead - r * total * 2.0 * ARM_M * ARM_M,
    )


def ground_effect_factor(centre_height_m: float) -> float:
    """Thrust near the ground over thrust far from it, for a height of the centre of gravity."""
    height_m = max(centre_height_m + ROTOR_ABOVE_CENTRE_M, _LOWEST_HEIGHT_M)
    ratio = ROTOR_RADIUS_M / (4.0 * height_m)
    return 1.0 / (1.0 - ratio * ratio)
