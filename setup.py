"""One distribution with all packages, which is also the ament package `emir_ros`.

All of it stands here and none in pyproject.toml, because colcon's build sees only this file and
setup.cfg when it installs by symbolic links.
"""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "emir_ros"  # also in package.xml: colcon finds an earlier build by it


def matching(pattern: str) -> list[str]:
    """Return the files of the checkout that match, by relative path as setuptools wants them."""
    return [str(path) for path in sorted(Path().glob(pattern))]


setup(
    name=NAME,
    version="0.1.0",
    description="EMIR, a large hydraulic robot arm: simulated machine, control and diagnosis",
    license="Apache-2.0",
    python_requires=">=3.11,<3.13",
    packages=find_packages(include=["emir_*"]),
    package_data={"": ["py.typed", "data/*.yaml", "bench/*.c"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", matching("emir_ros/launch/*.launch.py")),
        (f"share/{NAME}/config", matching("emir_ros/config/*.yaml")),
        (f"share/{NAME}/layouts", matching("emir_ros/layouts/*")),
        (f"lib/{NAME}", matching("emir_ros/executables/*_node")),
    ],
    entry_points={"console_scripts": ["emir = emir_analysis.cli:main"]},
    install_requires=[
        "matplotlib>=3.8",
        "mcap>=1.5,<1.7",  # mcap_writer.py reaches into its Writer
        "mcap-ros2-support>=0.5,<0.7",  # import_command.py takes what it serializes by
        "numba>=0.59",
        "numpy>=1.26",
        "plotly>=6.0",
        "pyyaml>=6.0.1",
        "scipy>=1.12",
        "zstandard>=0.22",
    ],
    extras_require={
        # ROS 2 Jazzy without an installation of ROS; not wanted where a Jazzy is sourced.
        "ros": ["ros-jazzy-common-interfaces==5.3.6", "ros-jazzy-rclpy[fastrtps]==7.1.6"],
        # The whole robot's mechanics; the main joint does without.
        "robot": ["pin>=4.1"],
        # The blind test on the machines of a Dask cluster.
        "cluster": ["distributed>=2024.8"],
        # Linear models as python-control systems: emir linearize.
        "design": ["control>=0.10"],
        # `emir view`: the page in the browser.
        "view": ["viser>=1.1"],
        # The model predictive control (`--controller mpc`); the others do without.
        "mpc": ["osqp>=1.0"],
        "test": [
            "control>=0.10",
            "distributed>=2024.8",
            "mujoco>=3.2",
            "osqp>=1.0",
            "pandas>=2.2",
            "playwright>=1.40",
            "pytest>=8.2",
            "pytest-timeout>=2.3",
            "pytest-xdist>=3.8",
            "rosbags>=0.10",
        ],
        # What `emir bench diagnosis` stands beside; these hold numpy back (an environment apart).
        "identification": ["pysindy>=2.1", "sysidentpy>=0.9"],
        # What `emir bench` stands beside; what is missing, it says.
        "bench": ["do-mpc>=5.0", "mujoco>=3.2", "osqp>=1.0", "rosbags>=0.10"],
        # What ruff and mypy report changes with every minor release: raise them on purpose.
        "lint": [
            "mypy~=2.4.1",
            "pre-commit>=4.0",
            "ruff~=0.17.5",
            "scipy-stubs>=1.17",
            "types-PyYAML>=6.0",
        ],
    },
)
