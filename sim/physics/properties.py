"""JSBSim's property paths, each spelled once, with the unit that JSBSim gives it.

`{}` stands for the index of an engine (front right, rear left, front left, rear right:
the order of the bundled F450) or of a gear unit.
"""

from typing import Final

# Initial conditions
IC_LATITUDE_GEODETIC_DEG: Final = "ic/lat-geod-deg"
IC_LONGITUDE_DEG: Final = "ic/long-gc-deg"
IC_TERRAIN_ELEVATION_FT: Final = "ic/terrain-elevation-ft"
IC_HEIGHT_ABOVE_GROUND_FT: Final = "ic/h-agl-ft"
IC_HEADING_TRUE_DEG: Final = "ic/psi-true-deg"

# Inputs. The external ESC inputs drive the motors alone: see sim/physics/airframe.py.
ESC_COMMANDS_NORM: Final = (
    "fcs/cmdFR_ext_nd",
    "fcs/cmdAL_ext_nd",
    "fcs/cmdFL_ext_nd",
    "fcs/cmdAR_ext_nd",
)
ROTATION_INTEGRATOR: Final = "simulation/integrator/position/rotational"
SET_RUNNING: Final = "propulsion/set-running"
WIND_NED_FPS: Final = (
    "atmosphere/wind-north-fps",
    "atmosphere/wind-east-fps",
    "atmosphere/wind-down-fps",
)
ROTOR_DRAG_FORWARD_LBS: Final = "external_reactions/rotor-drag-forward/magnitude"
ROTOR_DRAG_RIGHT_LBS: Final = "external_reactions/rotor-drag-right/magnitude"
ROTOR_DRAG_LBFFT: Final = "external_reactions/rotor-drag/magnitude-lbsft"
GROUND_EFFECT_LBS: Final = "external_reactions/ground-effect/magnitude"
ROLLING_FRICTION: Final = "gear/unit[{}]/rolling_friction_coeff"
STATIC_FRICTION: Final = "gear/unit[{}]/static_friction_coeff"
GEAR_UNITS: Final = "gear/num-units"

# State after a step
LATITUDE_GEODETIC_DEG: Final = "position/lat-geod-deg"
LONGITUDE_DEG: Final = "position/long-gc-deg"
ALTITUDE_GEODETIC_FT: Final = "position/geod-alt-ft"
HEIGHT_ABOVE_GROUND_FT: Final = "position/h-agl-ft"
VELOCITY_NED_FPS: Final = (
    "velocities/v-north-fps",
    "velocities/v-east-fps",
    "velocities/v-down-fps",
)
ATTITUDE_RAD: Final = ("attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad")
RATE_FRD_RAD_S: Final = (
    "velocities/p-rad_sec",
    "velocities/q-rad_sec",
    "velocities/r-rad_sec",
)
INERTIAL_RATE_FRD_RAD_S: Final = (
    "velocities/pi-rad_sec",
    "velocities/qi-rad_sec",
    "velocities/ri-rad_sec",
)
AIR_VELOCITY_FRD_FPS: Final = (
    "velocities/u-aero-fps",
    "velocities/v-aero-fps",
    "velocities/w-aero-fps",
)
AERODYNAMIC_FORCE_FRD_LBS: Final = (
    "forces/fbx-aero-lbs",
    "forces/fby-aero-lbs",
    "forces/fbz-aero-lbs",
)
PROPULSIVE_FORCE_FRD_LBS: Final = (
    "forces/fbx-prop-lbs",
    "forces/fby-prop-lbs",
    "forces/fbz-prop-lbs",
)
GEAR_FORCE_FRD_LBS: Final = (
    "forces/fbx-gear-lbs",
    "forces/fby-gear-lbs",
    "forces/fbz-gear-lbs",
)
EXTERNAL_FORCE_FRD_LBS: Final = (
    "forces/fbx-external-lbs",
    "forces/fby-external-lbs",
    "forces/fbz-external-lbs",
)
TOTAL_FORCE_FRD_LBS: Final = (
    "forces/fbx-total-lbs",
    "forces/fby-total-lbs",
    "forces/fbz-total-lbs",
)
MASS_SLUGS: Final = "inertia/mass-slugs"
TRUE_AIRSPEED_FPS: Final = "velocities/vt-fps"
PRESSURE_PSF: Final = "atmosphere/P-psf"
DENSITY_SLUGS_FT3: Final = "atmosphere/rho-slugs_ft3"
TEMPERATURE_R: Final = "atmosphere/T-R"
ROTOR_SPEED_RPM: Final = "propulsion/engine[{}]/propeller-rpm"
MOTOR_CURRENT_A: Final = "propulsion/engine[{}]/current-amperes"
