"""What pyproject.toml cannot say: the example plans go along with the simulator, as its data."""

from setuptools import find_packages, setup

PROGRAMS = (
    "afarcloud",
    "edge_server",
    "farm_flight_bridge",
    "mavlink_broker",
    "sim",
    "uav_firmware",
)

setup(
    packages=[
        *find_packages(include=[pattern for name in PROGRAMS for pattern in (name, f"{name}.*")]),
        "sim.examples",
    ],
    package_dir={"sim.examples": "examples/plans"},
    package_data={
        **{name: ["py.typed"] for name in PROGRAMS},
        "edge_server.store.migrations": ["script.py.mako"],
        "sim.examples": ["*.json"],
    },
)
